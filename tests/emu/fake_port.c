#include "fake_port.h"

#include "only_board.h"
#include "spi_word_by_word.h"
#include "wire/messages_gen.h"

#include <stdatomic.h>
#include <string.h>

#define TRANSFER_NS (16u * 1000000000u / BT_SPI_HZ)

fake_port fake;
uint16_t fake_started_by = BT_FAULT_FLAG_STARTED;
uint32_t fake_kept[PORT_KEPT_BYTES / 4];
uint8_t fake_map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
bool (*fake_host_accepts)(const uint8_t *data, size_t bytes);

static uint64_t now_ns(void)
{
    return atomic_load_explicit(&fake.now_ns, memory_order_relaxed);
}

static void pass(uint64_t ns)
{
    atomic_store_explicit(&fake.now_ns, now_ns() + ns, memory_order_relaxed);
}

static uint64_t released_ns;
static bool released;
static bool armed;
static uint32_t alarm_us;
static uint8_t incoming[512];
static size_t incoming_bytes;

void fake_reset(bt_emu_source source, uint64_t start_ns)
{
    memset(&fake, 0, sizeof fake);
    flash_new(&fake.flash, fake.kept, sizeof fake.kept);
    fake.now_ns = start_ns;
    fake.shortest_gap_ns = UINT64_MAX;
    fake.link_turns = 1;
    released = false;
    armed = false;
    incoming_bytes = 0;
    bt_emu_bus_init(&fake.bus, BT_MAX_FINGERS, "", source, NULL);
}

bool fake_next_interrupt(void)
{
    if (!armed) {
        return false;
    }
    // The alarm's time in 64 bits, from a difference modulo 2^32 as port.h defines it.
    int32_t ahead_us = (int32_t)(alarm_us - port_now_us(ONLY_BOARD));
    uint64_t at_ns = ahead_us > 0 ? (now_ns() / 1000 + (uint64_t)ahead_us) * 1000 : now_ns();
    at_ns += fake.held_off_ns;
    fake.held_off_ns = 0;
    pass(at_ns > now_ns() ? at_ns - now_ns() : 0);
    armed = false;
    (void)bt_port_alarm();
    return true;
}

void fake_interrupts_until(uint64_t end_ns)
{
    while (now_ns() < end_ns && fake_next_interrupt()) {
    }
}

void fake_host_sends(const uint8_t *data, size_t bytes)
{
    memcpy(incoming + incoming_bytes, data, bytes);
    incoming_bytes += bytes;
}

// ---- port.h ------------------------------------------------------------------------------------

uint32_t port_now_us(bt_port *port)
{
    return (uint32_t)(now_ns() / 1000);
}

void port_delay_us(bt_port *port, uint32_t us)
{
    pass((uint64_t)us * 1000);
}

void port_alarm_at(bt_port *port, uint32_t at_us)
{
    alarm_us = at_us;
    armed = true;
}

void port_spi_select(bt_port *port, uint8_t mask)
{
    uint8_t selected = fake.bus.selected;
    if (selected == 0 && mask != 0 && released && now_ns() - released_ns < fake.shortest_gap_ns) {
        fake.shortest_gap_ns = now_ns() - released_ns;
    }
    if (selected != 0 && mask == 0) {
        released_ns = now_ns();
        released = true;
    }
    bt_emu_bus_select(&fake.bus, mask, now_ns());
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    uint8_t selected = fake.bus.selected;
    if (mosi & 0x8000) {
        sent_command command = {.t_ns = now_ns(), .mosi = mosi, .mask = selected};
        if (fake.on_command != NULL) {
            fake.on_command(&command);
        }
    } else if (selected == 0 || (selected & (selected - 1)) != 0) {
        fake.selected_reads++;
    }
    uint16_t miso = bt_emu_bus_transfer16(&fake.bus, mosi, now_ns());
    pass(TRANSFER_NS);
    return miso;
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    uint8_t miso = bt_emu_bus_transfer8(&fake.bus, mosi, now_ns());
    pass(TRANSFER_NS / 2);
    return miso;
}

bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes)
{
    return fake_host_accepts(data, bytes);
}

size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes)
{
    if (link != 0) {
        return 0;
    }
    size_t n = incoming_bytes < bytes ? incoming_bytes : bytes;
    memcpy(data, incoming, n);
    incoming_bytes -= n;
    memmove(incoming, incoming + n, incoming_bytes);
    return n;
}

uint32_t port_link_turns(bt_port *port, unsigned link)
{
    return link == 0 ? fake.link_turns : 0;
}

bool port_link_touched(bt_port *port)
{
    const bool touched = fake.touched;
    fake.touched = false;
    return touched;
}

void port_link_uart(bt_port *port, uint32_t bits_per_s)
{
    fake.bits_per_s = bits_per_s;
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    flash_erase(&fake.flash, sector_offset);
    return true;
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    if (fake.flash_broken) {
        return false;
    }
    flash_program(&fake.flash, page_offset, page);
    return true;
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, fake.kept + offset, bytes);
}

bool port_reboot(bt_port *port, bool into_bootloader)
{
    fake.reboots++;
    return fake.has_loader;
}

void port_measure(bt_port *port, bt_msg_board_facts *facts)
{
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
}

port_identity port_identify(bt_port *port)
{
    return (port_identity){.hello = {.board = BT_BOARD_POSIX_SIM,
                                     .board_serial = "fake-board-1",
                                     .board_name = "fake",
                                     .boot_id = 42,
                                     .image_crc32 = UINT32_MAX},
                           .started_by = fake_started_by,
                           .kept = fake_kept};
}

port_abilities port_describe(bt_port *port)
{
    return (port_abilities){
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = fake_map_ram[0],
        .maps = fake.kept + BT_STORAGE_BYTES,
    };
}
