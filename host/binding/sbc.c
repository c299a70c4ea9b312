// The port of boards in this process: their link, their clock, and flash that is memory. One has its sensors
// on a bus, spidev's; the other has none, and is given whole rounds.
//
// How spidev's bus differs from a microcontroller's, and what is done about it:
// - It selects one sensor at a time. A word for several is sent to one after the other, so fingers sample
//   not at once but one transfer apart; the 50 us run from the last of them.
// - It raises the chip select after every call: nothing here has more than one transfer in a period.
#include "sbc.h"

#include "gateway.h"
#include "map/store.h"
#include "port.h"
#include "spi_word_by_word.h"
#include "talk/rounds.h"
#include "talk/sensors.h"

#include <stdlib.h>
#include <string.h>

struct bt_port {
    bt_gateway gateway;
    void *python;
    uint8_t devices; // bit mask of fingers that are wired
    bool no_bus, untimed;
    uint32_t boot_id;
    uint32_t due_us;
    uint8_t selected;
    bool unsent; // the last word was for sensors that are not wired
    _Alignas(4) uint8_t maps[BT_MAPS_BYTES];
    _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
};

bt_sbc *bt_sbc_new(void *python, uint8_t devices, bool timed, uint32_t boot_id)
{
    bt_sbc *sbc = calloc(1, sizeof *sbc);
    if (sbc != NULL) {
        sbc->python = python;
        sbc->devices = (uint8_t)((1u << devices) - 1);
        sbc->no_bus = devices == 0;
        sbc->untimed = !timed;
        sbc->boot_id = boot_id;
    }
    return sbc;
}

void bt_sbc_free(bt_sbc *sbc)
{
    free(sbc);
}

void bt_sbc_start(bt_sbc *sbc)
{
    bt_gateway_init(&sbc->gateway, sbc);
}

void bt_sbc_poll(bt_sbc *sbc)
{
    bt_gateway_poll(&sbc->gateway);
}

void bt_sbc_alarm(bt_sbc *sbc)
{
    (void)bt_gateway_alarm(&sbc->gateway);
}

uint32_t bt_sbc_due_us(const bt_sbc *sbc)
{
    return sbc->due_us;
}

// ---- whole rounds ------------------------------------------------------------------------------

void bt_sbc_sensor(bt_sbc *sbc, uint8_t f, const uint8_t serial[BT_SERIAL_BYTES], bool foreign)
{
    bt_session *session = &sbc->gateway.session;
    const bool known = session->info[f].present || session->finger[f].foreign;
    foreign = foreign || bt_serial_is_foreign(serial);
    if (known && !foreign && !session->finger[f].foreign) {
        bt_sensors_answer(session, f, serial);
        return;
    }
    const bool other = known && memcmp(session->info[f].serial, serial, BT_SERIAL_BYTES) != 0;
    memcpy(session->info[f].serial, serial, BT_SERIAL_BYTES);
    session->info[f].finger = f;
    session->info[f].present = !foreign;
    session->finger[f].foreign = foreign;
    session->finger[f].present = true;
    bt_session_sensor_changed(session, f, other);
}

static void send_sp(bt_session *session, const bt_finger *finger,
                    const uint16_t counts[BT_FOREIGN_ELECTRODES])
{
    bt_msg_sp_counts msg = {
        .seq = (uint16_t)(finger->seq - 1), .t_us = finger->round.t_us, .finger = finger->index};
    memcpy(msg.counts, counts, sizeof msg.counts);
    bt_msg_sp_counts_send(session, &msg);
}

void bt_sbc_round(bt_sbc *sbc, uint32_t t_us, const uint32_t *slot_us, const uint16_t *counts,
                  uint8_t sp_fingers, const uint16_t *sp_counts)
{
    bt_session *session = &sbc->gateway.session;
    session->unsure = 0; // who sends the round says whose it is
    bt_session_begin(session, t_us);
    for (uint8_t s = 0; s < BT_SLOTS; s++, counts += BT_MAX_FINGERS) {
        for (int f = 0; f < BT_MAX_FINGERS; f++) {
            session->finger[f].words.good += counts[f] != BT_INVALID_COUNT;
        }
        bt_session_slot(session, s, counts, t_us + slot_us[s]);
    }
    bt_session_end_round(session);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        const bool streams = session->status.streams & BT_STREAM_FLAG_FRAMES && session->fingers >> f & 1;
        if (sp_fingers >> f & 1 && streams) {
            send_sp(session, &session->finger[f], sp_counts + f * BT_FOREIGN_ELECTRODES);
        }
    }
}

// ---- time -------------------------------------------------------------------------------------

uint32_t port_now_us(bt_port *board)
{
    return bt_sbc_now_us(board->python);
}

void port_delay_us(bt_port *board, uint32_t us)
{
    // Nobody needs a pause from what never was on the bus, and four absent fingers' would cost a tenth of a
    // slot.
    if (!board->unsent) {
        bt_sbc_delay_us(board->python, us);
    }
}

void port_alarm_at(bt_port *board, uint32_t at_us)
{
    board->due_us = at_us;
}

// ---- SPI --------------------------------------------------------------------------------------

void port_spi_select(bt_port *board, uint8_t mask)
{
    board->selected = mask & board->devices;
    board->unsent = mask != 0 ? board->selected == 0 : board->unsent;
}

uint16_t port_spi_transfer16(bt_port *board, uint16_t mosi)
{
    uint16_t miso = 0;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (board->selected >> f & 1) {
            uint8_t bytes[2] = {(uint8_t)(mosi >> 8), (uint8_t)mosi};
            bt_sbc_exchange(board->python, f, bytes, sizeof bytes);
            miso |= (uint16_t)(bytes[0] << 8 | bytes[1]);
        }
    }
    return miso;
}

uint8_t port_spi_transfer8(bt_port *board, uint8_t mosi)
{
    uint8_t miso = 0;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (board->selected >> f & 1) {
            uint8_t byte = mosi;
            bt_sbc_exchange(board->python, f, &byte, 1);
            miso |= byte;
        }
    }
    return miso;
}

// ---- link -------------------------------------------------------------------------------------

bool port_link_write(bt_port *board, unsigned link, const uint8_t *data, size_t bytes)
{
    return link == 0 && bt_sbc_link_write(board->python, data, bytes);
}

size_t port_link_read(bt_port *board, unsigned link, uint8_t *data, size_t bytes)
{
    return link == 0 ? bt_sbc_link_read(board->python, data, bytes) : 0;
}

uint32_t port_link_turns(bt_port *board, unsigned link)
{
    return link == 0; // the host is this process
}

void port_link_uart(bt_port *board, uint32_t bits_per_s)
{
}

bool port_link_touched(bt_port *board)
{
    return false;
}

// ---- flash: none, so settings and maps last as long as the process; maps are kept in memory ------

bool port_flash_erase(bt_port *board, uint32_t sector_offset)
{
    if (sector_offset < BT_STORAGE_BYTES) {
        return false;
    }
    memset(board->maps + (sector_offset - BT_STORAGE_BYTES), 0xFF, BT_FLASH_SECTOR_BYTES);
    return true;
}

bool port_flash_program(bt_port *board, uint32_t page_offset, const uint8_t *page)
{
    if (page_offset < BT_STORAGE_BYTES) {
        return false;
    }
    for (int k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        board->maps[page_offset - BT_STORAGE_BYTES + (uint32_t)k] &=
            page[k]; // as flash does: a page comes in parts
    }
    return true;
}

void port_flash_read(bt_port *board, uint32_t offset, uint8_t *data, size_t bytes)
{
    memset(data, 0xFF, bytes);
}

bool port_reboot(bt_port *board, bool into_bootloader)
{
    return false;
}

void port_measure(bt_port *board, bt_msg_board_facts *facts)
{
}

void port_spi_rate(bt_port *board, uint32_t khz)
{
}

// ---- identity ---------------------------------------------------------------------------------

port_identity port_identify(bt_port *board)
{
    static const bt_msg_hello who[] = {
        {.board = BT_BOARD_LINUX_SBC, .board_serial = "linux-spidev", .board_name = "Linux spidev"},
        {.board = BT_BOARD_MESSAGES, .board_serial = "messages", .board_name = "messages"},
    };
    port_identity identity = {.hello = who[board->no_bus], .started_by = BT_FAULT_FLAG_STARTED};
    identity.hello.boot_id = board->boot_id;
    identity.hello.image_crc32 = UINT32_MAX;
    return identity;
}

port_abilities port_describe(bt_port *board)
{
    return (port_abilities){
        .no_bus = board->no_bus,
        .untimed = board->untimed,
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = board->map_ram[0],
        .maps = board->maps,
    };
}
