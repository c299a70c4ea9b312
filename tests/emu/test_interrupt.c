// The sampling interrupt on a thread of its own, the main loop on another, ThreadSanitizer between them:
// whatever both of them touch without an atomic's order is told. On one core an interrupt is never at the
// same time; the order that it needs is the same.
//
//   test_interrupt            exit 0: no data race
//   test_interrupt --defect   the main loop looks at what is the interrupt's alone, which must be told
#include "bus.h"
#include "gateway.h"
#include "map/store.h"
#include "only_board.h"
#include "spi_word_by_word.h"
#include "talk/host_link.h"
#include "wire/framing.h"
#include "wire/messages_gen.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#define ROUND_NS     10000000ull
#define ROUNDS       500
#define TRANSFER_NS  (16u * 1000000000u / BT_SPI_HZ)
#define AHEAD_ALARMS 200 // by which the interrupt may be ahead of the main loop: some slots are lost then
#define AWAY_FROM    200 // rounds, in which finger 2 is not there, so that it is asked who it is
#define AWAY_TO      300

static bt_gateway gateway;
static bt_emu_bus bus;
static _Alignas(4) uint8_t flash[BT_KEPT_BYTES];
static _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];

// Relaxed, all of them: they must not lend their order to what is watched.
static _Atomic uint64_t now_ns = 1000000;
static _Atomic uint32_t alarms, seen_alarms; // those that were, and of those the main loop came after
static uint32_t alarm_us;                    // once started, the interrupt's

static uint32_t frames, damaged;
static bool asked; // a property, after the start; the interrupt's
static bt_deframer deframer;

static uint64_t now(void)
{
    return atomic_load_explicit(&now_ns, memory_order_relaxed);
}

static void pass(uint64_t ns)
{
    atomic_store_explicit(&now_ns, now() + ns, memory_order_relaxed);
}

static uint32_t load_relaxed(_Atomic uint32_t *count)
{
    return atomic_load_explicit(count, memory_order_relaxed);
}

static uint16_t count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    (void)context;
    uint64_t round = t_ns / ROUND_NS;
    if (finger == 2 && round >= AWAY_FROM && round < AWAY_TO) {
        return BT_EMU_FAULT_UNPLUGGED;
    }
    return channel == BT_EMU_LINE ? 0 : (uint16_t)(1500 + channel);
}

bool bt_port_alarm(void)
{
    return bt_gateway_alarm(&gateway);
}

static void *interrupts(void *nothing)
{
    while (now() < ROUNDS * ROUND_NS) {
        while (load_relaxed(&alarms) - load_relaxed(&seen_alarms) > AHEAD_ALARMS) {
        }
        uint64_t at_ns = (uint64_t)alarm_us * 1000;
        pass(at_ns > now() ? at_ns - now() : 0);
        (void)bt_port_alarm();
        atomic_store_explicit(&alarms, load_relaxed(&alarms) + 1, memory_order_relaxed);
    }
    return nothing;
}

static void start_stream(void)
{
    uint8_t payload[BT_START_BYTES], encoded[BT_ENCODED_MAX_BYTES];
    bt_msg_start start = {1, BT_STREAM_FLAG_FRAMES | BT_STREAM_FLAG_PAC, 0x1F, 0};
    bt_msg_start_pack(&start, payload);
    size_t bytes = bt_frame_encode(BT_START_ID, payload, sizeof payload, encoded);
    bt_session_receive(&gateway.session, 0, encoded, bytes, port_now_us(ONLY_BOARD));
}

int main(int argc, char **argv)
{
    bool defect = argc > 1 && strcmp(argv[1], "--defect") == 0;
    uint32_t looked = 0;
    memset(flash, 0xFF, sizeof flash);
    bt_emu_bus_init(&bus, BT_MAX_FINGERS, "", count, NULL);
    bt_gateway_init(&gateway, ONLY_BOARD);
    start_stream();
    pthread_t thread;
    if (pthread_create(&thread, NULL, interrupts, NULL) != 0) {
        return 2;
    }
    while (now() < ROUNDS * ROUND_NS) {
        uint32_t before = load_relaxed(&alarms);
        bt_gateway_poll(&gateway);
        looked += defect ? gateway.sampler.fraction : 0;
        atomic_store_explicit(&seen_alarms, before, memory_order_relaxed);
    }
    (void)pthread_join(thread, NULL);
    printf("%u frames, %u damaged, %u slots late, %u%s\n", frames, damaged, gateway.session.status.slots_late,
           looked, asked ? ", finger 2 was asked who it is" : "");
    return frames < BT_MAX_FINGERS * ROUNDS / 2 || damaged > 0 || !asked;
}

// ---- port.h ----------------------------------------------------------------------------------------------

uint32_t port_now_us(bt_port *port)
{
    return (uint32_t)(now() / 1000);
}

void port_delay_us(bt_port *port, uint32_t us)
{
    pass((uint64_t)us * 1000);
}

void port_alarm_at(bt_port *port, uint32_t at_us)
{
    alarm_us = at_us;
}

void port_spi_select(bt_port *port, uint8_t mask)
{
    bt_emu_bus_select(&bus, mask, now());
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    asked = asked || (mosi >> 8 == BT_PROPERTY_READ_COMMAND && now() > AWAY_FROM * ROUND_NS);
    uint16_t miso = bt_emu_bus_transfer16(&bus, mosi, now());
    pass(TRANSFER_NS);
    return miso;
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    uint8_t miso = bt_emu_bus_transfer8(&bus, mosi, now());
    pass(TRANSFER_NS / 2);
    return miso;
}

bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&deframer, data[k]);
        frames += outcome == BT_DEFRAMED_GOOD && deframer.id == BT_FRAME_ID;
        damaged += outcome > BT_DEFRAMED_GOOD;
    }
    return true;
}

size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes)
{
    return 0;
}

uint32_t port_link_turns(bt_port *port, unsigned link)
{
    return link == 0;
}

bool port_link_touched(bt_port *port)
{
    return false;
}

void port_link_uart(bt_port *port, uint32_t bits_per_s)
{
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    memset(flash + sector_offset, 0xFF, BT_FLASH_SECTOR_BYTES);
    return true;
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    memcpy(flash + page_offset, page, BT_FLASH_PAGE_BYTES);
    return true;
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, flash + offset, bytes);
}

bool port_reboot(bt_port *port, bool into_bootloader)
{
    return false;
}

void port_measure(bt_port *port, bt_msg_board_facts *facts)
{
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
}

port_identity port_identify(bt_port *port)
{
    return (port_identity){.hello = {.board = BT_BOARD_POSIX_SIM, .boot_id = 1, .image_crc32 = UINT32_MAX}};
}

port_abilities port_describe(bt_port *port)
{
    return (port_abilities){
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = map_ram[0],
        .maps = flash + BT_STORAGE_BYTES,
    };
}
