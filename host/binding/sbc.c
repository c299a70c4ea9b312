// The port of boards in this process: link, clock, and flash in memory. One kind has sensors on a bus,
// spidev's; the other has none, and is given whole rounds.
//
// Differences of spidev's bus from a microcontroller's, and how they are handled:
// - It selects one sensor at a time. A word for several is sent to one after the other, so fingers sample
//   one transfer apart; the 50 us run from the last of them.
// - It raises the chip select after every call: nothing here has more than one transfer in a period.
#include "sbc.h"

#include "in_process.h"

#include "map/store.h"
#include "talk/rounds.h"
#include "talk/sensors.h"

#include <stdlib.h>
#include <string.h>

struct bt_sbc {
    bt_port port;
    void *python;
    uint8_t devices; // bit mask of fingers that are wired
    bool no_bus, untimed;
    uint32_t boot_id;
    uint8_t selected;
    bool unsent; // the last word was for sensors that are not wired
    _Alignas(4) uint8_t maps[BT_MAPS_BYTES];
    _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
};

// ---- whole rounds ------------------------------------------------------------------------------

void bt_sbc_sensor(bt_sbc *sbc, uint8_t f, const uint8_t serial[BT_SERIAL_BYTES], bool foreign)
{
    bt_session *session = &sbc->port.gateway.session;
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
    bt_session *session = &sbc->port.gateway.session;
    session->unsure = 0; // the round's sender names the sensor
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

// ---- the port ---------------------------------------------------------------------------------

static bt_sbc *of(bt_port *port)
{
    return (bt_sbc *)port;
}

static uint32_t now_us(bt_port *port)
{
    return bt_sbc_now_us(of(port)->python);
}

static void delay_us(bt_port *port, uint32_t us)
{
    // A word that never was on the bus needs no pause, and four absent fingers' would cost a tenth of a slot.
    if (!of(port)->unsent) {
        bt_sbc_delay_us(of(port)->python, us);
    }
}

static void select_sensors(bt_port *port, uint8_t mask)
{
    bt_sbc *sbc = of(port);
    sbc->selected = mask & sbc->devices;
    sbc->unsent = mask != 0 ? sbc->selected == 0 : sbc->unsent;
}

static uint16_t transfer16(bt_port *port, uint16_t mosi)
{
    const bt_sbc *sbc = of(port);
    uint16_t miso = 0;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (sbc->selected >> f & 1) {
            uint8_t bytes[2] = {(uint8_t)(mosi >> 8), (uint8_t)mosi};
            bt_sbc_exchange(sbc->python, f, bytes, sizeof bytes);
            miso |= (uint16_t)(bytes[0] << 8 | bytes[1]);
        }
    }
    return miso;
}

static uint8_t transfer8(bt_port *port, uint8_t mosi)
{
    const bt_sbc *sbc = of(port);
    uint8_t miso = 0;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (sbc->selected >> f & 1) {
            uint8_t byte = mosi;
            bt_sbc_exchange(sbc->python, f, &byte, 1);
            miso |= byte;
        }
    }
    return miso;
}

static bool write_link(bt_port *port, const uint8_t *data, size_t bytes)
{
    return bt_sbc_link_write(of(port)->python, data, bytes);
}

static size_t read_link(bt_port *port, uint8_t *data, size_t bytes)
{
    return bt_sbc_link_read(of(port)->python, data, bytes);
}

static uint32_t turns(bt_port *port)
{
    (void)port;
    return 1; // the host is this process
}

// No flash: settings and maps last as long as the process; maps are in memory.
static bool erase(bt_port *port, uint32_t sector_offset)
{
    if (sector_offset < BT_STORAGE_BYTES) {
        return false;
    }
    memset(of(port)->maps + (sector_offset - BT_STORAGE_BYTES), 0xFF, BT_FLASH_SECTOR_BYTES);
    return true;
}

static bool program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    if (page_offset < BT_STORAGE_BYTES) {
        return false;
    }
    for (uint32_t k = 0; k < BT_FLASH_PAGE_BYTES; k++) { // as flash does: a page comes in parts
        of(port)->maps[page_offset - BT_STORAGE_BYTES + k] &= page[k];
    }
    return true;
}

static void read_flash(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    (void)port, (void)offset;
    memset(data, 0xFF, bytes);
}

static bool reboot(bt_port *port)
{
    (void)port;
    return false;
}

static port_identity identify(bt_port *port)
{
    static const bt_msg_hello who[] = {
        {.board = BT_BOARD_LINUX_SBC, .board_serial = "linux-spidev", .board_name = "Linux spidev"},
        {.board = BT_BOARD_MESSAGES, .board_serial = "messages", .board_name = "messages"},
    };
    port_identity identity = {.hello = who[of(port)->no_bus], .started_by = BT_FAULT_FLAG_STARTED};
    identity.hello.boot_id = of(port)->boot_id;
    identity.hello.image_crc32 = UINT32_MAX;
    return identity;
}

static port_abilities describe(bt_port *port)
{
    bt_sbc *sbc = of(port);
    return (port_abilities){
        .no_bus = sbc->no_bus,
        .untimed = sbc->untimed,
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = sbc->map_ram[0],
        .maps = sbc->maps,
    };
}

static const bt_port_kind kind = {
    .now_us = now_us,
    .delay_us = delay_us,
    .select = select_sensors,
    .transfer16 = transfer16,
    .transfer8 = transfer8,
    .write = write_link,
    .read = read_link,
    .turns = turns,
    .erase = erase,
    .program = program,
    .read_flash = read_flash,
    .reboot = reboot,
    .identify = identify,
    .describe = describe,
};

// ---- for Python -------------------------------------------------------------------------------

bt_sbc *bt_sbc_new(void *python, uint8_t devices, bool timed, uint32_t boot_id)
{
    bt_sbc *sbc = calloc(1, sizeof *sbc);
    if (sbc != NULL) {
        sbc->port.kind = &kind;
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
    bt_gateway_init(&sbc->port.gateway, &sbc->port);
}

void bt_sbc_poll(bt_sbc *sbc)
{
    bt_gateway_poll(&sbc->port.gateway);
}

void bt_sbc_alarm(bt_sbc *sbc)
{
    (void)bt_gateway_alarm(&sbc->port.gateway);
}

uint32_t bt_sbc_due_us(const bt_sbc *sbc)
{
    return sbc->port.alarm_us;
}
