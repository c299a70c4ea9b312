#include "gateway.h"

#include "port.h"
#include "properties.h"
#include "talk/host_link.h"
#include "talk/rounds.h"
#include "talk/saved.h"
#include "talk/sensors.h"
#include "word.h"

#include "version.h"

#include <string.h>

_Static_assert(sizeof(bt_kept_tares) <= PORT_KEPT_BYTES, "there is room for what outlives a hang");

_Static_assert(PORT_LINKS == BT_LINKS, "the session has a deframer for every link");

// The gap after the last property read, plus the time of a slow board from here to setting its alarm. An
// alarm in the past would make the first slot and its frame's time late.
#define START_AHEAD_US (BT_GAP_US + 50)

// ---- the port for the core: the session's context is the gateway, the flash's is the port

static bool erase_sector(void *port, uint32_t sector_offset)
{
    return port_flash_erase(port, sector_offset);
}

static bool program_page(void *port, uint32_t page_offset, const uint8_t page[BT_FLASH_PAGE_BYTES])
{
    return port_flash_program(port, page_offset, page);
}

static void read_flash(void *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    port_flash_read(port, offset, data, bytes);
}

static bool write_link(void *context, unsigned link, const uint8_t *data, size_t bytes)
{
    const bt_gateway *gateway = context;
    return port_link_write(gateway->port, link, data, bytes);
}

static uint32_t now_us(void *context)
{
    const bt_gateway *gateway = context;
    return port_now_us(gateway->port);
}

static uint8_t leave(void *context, bool into_bootloader)
{
    const bt_gateway *gateway = context;
    return port_reboot(gateway->port, into_bootloader) ? BT_ERROR_OK : BT_ERROR_NOT_HERE;
}

static void measure(void *context, bt_msg_board_facts *msg)
{
    const bt_gateway *gateway = context;
    msg->usb_frame = UINT16_MAX;
    msg->die_centi_c = BT_INVALID_I16;
    msg->bus_khz = BT_SPI_HZ / 1000;
    msg->slots_dma_late = gateway->sampler.dma_late;
    port_measure(gateway->port, msg);
}

static void clock_bus(void *context, uint16_t khz)
{
    const bt_gateway *gateway = context;
    port_spi_rate(gateway->port, khz);
}

// ------------------------------------------------------------------------------------------------------

// A slower UART is not used: one FRAME would last longer than a link may wait.
#define UART_LEAST_BITS_PER_S 1200
#define DOUBTFUL_BYTES        64 // more than the first frame of a host

static void start_uart(const bt_gateway *gateway)
{
    const bt_settings *settings = &gateway->session.settings;
    int32_t bits_per_s = bt_settings_get(settings, BT_SETTING_UART_BITS_PER_S);
    const bool none = bits_per_s < UART_LEAST_BITS_PER_S || gateway->uart_by_default;
    port_link_uart(gateway->port, none ? 0 : (uint32_t)bits_per_s);
}

void bt_gateway_init(bt_gateway *gateway, bt_port *port)
{
    const port_abilities can = port_describe(port);
    const bt_board_actions actions = {
        .reboot = leave,
        .measure = measure,
        .set_bus_rate = clock_bus,
        .flash = &gateway->flash,
        .maps = can.map_bytes != 0 ? &gateway->map_flash : NULL,
        .now_us = can.no_bus ? NULL : now_us,
    };
    gateway->port = port;
    gateway->flash = (bt_flash){.sector_bytes = can.erase_bytes,
                                .context = port,
                                .erase = erase_sector,
                                .program = program_page,
                                .read = read_flash};
    gateway->map_flash = (bt_map_flash){
        .flash = &gateway->flash,
        .slot_bytes = (can.map_bytes + can.erase_bytes - 1) / can.erase_bytes * can.erase_bytes,
        .max_bytes = can.map_bytes,
        .slots = (uint8_t)BT_MAP_SLOTS_OF(can.fingers),
        .bytes = can.maps,
        .ram = can.map_ram,
    };
    const port_identity board = port_identify(port);
    bt_msg_hello hello = board.hello;
    hello.firmware_major = BT_VERSION_MAJOR;
    hello.firmware_minor = BT_VERSION_MINOR;
    hello.firmware_patch = BT_VERSION_PATCH;
    hello.fingers = can.fingers;
    hello.slot_hz = can.untimed ? 0 : BT_SLOT_HZ;
    const bool resumed =
        board.kept != NULL && board.started_by & (BT_FAULT_FLAG_HUNG | BT_FAULT_FLAG_CRASHED);
    gateway->kept = board.kept;
    const uint32_t powered_us = port_now_us(port);
    if (!resumed && powered_us < BT_POWER_ON_MS * 1000) { // after a resume, the sensors had power all along
        port_delay_us(port, BT_POWER_ON_MS * 1000 - powered_us);
    }
    bt_session_init(&gateway->session, &hello, write_link, gateway, port_now_us(port));
    gateway->session.board = actions;
    gateway->session.status.faults |= board.started_by;
    for (uint8_t f = 0; f < can.fingers && !can.no_bus; f++) {
        bt_properties_read(port, f, &gateway->sampler.query[f], &gateway->session.info[f]);
        gateway->session.finger[f].foreign = bt_serial_is_foreign(gateway->session.info[f].serial);
        gateway->session.finger[f].present = gateway->session.info[f].present;
        if (!gateway->session.info[f].present) {
            bt_sensors_doubt(&gateway->session, f);
        }
    }
    bt_session_load(&gateway->session); // a calibration needs to know the sensors
    if (resumed && bt_kept_tares_restore(gateway->kept, &gateway->session)) {
        gateway->session.status.faults |= BT_FAULT_FLAG_TARE_RESTORED;
    }
    start_uart(gateway);
    gateway->round_open = false;
    for (unsigned link = 0; link < PORT_LINKS; link++) {
        gateway->link_turns[link] = port_link_turns(port, link);
    }
    if (can.no_bus) {
        return;
    }
    // Absent sensors are read too: one plugged in later shows up by itself.
    uint32_t start_us = port_now_us(port) + START_AHEAD_US;
    bt_sampler_start(&gateway->sampler, port, (uint8_t)((1u << can.fingers) - 1), start_us,
                     bt_settings_get(&gateway->session.settings, BT_SETTING_SLOTS_BY_CORE) != 0);
    port_alarm_at(port, start_us);
}

_Static_assert(BT_SLOTS % 4 == 0, "a round's last slot wakes the main loop");

bool bt_gateway_alarm(bt_gateway *gateway)
{
    port_alarm_at(gateway->port, bt_sampler_alarm(&gateway->sampler));
    // A turn of the main loop costs more than a slot's work: every second slot wakes it, or every fourth
    // while nothing is touched.
    const uint8_t next = gateway->sampler.current.slot;
    const uint8_t group = atomic_load_explicit(&gateway->in_use, memory_order_relaxed) ? 2 : 4;
    return !gateway->sampler.commanded && next % group == 0;
}

static void count_word(bt_word_counts *counts, enum bt_word kind, uint16_t word)
{
    switch (kind) {
    case BT_WORD_GOOD:
        counts->good++;
        break;
    case BT_WORD_STUCK:
        counts->stuck++;
        break;
    case BT_WORD_ERROR:
        counts->error++;
        counts->last_error_word = word;
        break;
    case BT_WORD_PARITY:
        counts->parity++;
        break;
    }
}

// A request takes effect a round later than a fast main loop would need, so that all boards behave alike.
#define ASK_AHEAD_ROUNDS 2

// True if a finger is touched, or holds.
static bool is_in_use(const bt_session *session)
{
    bool in_use = false;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        const bt_finger *finger = &session->finger[f];
        in_use = in_use || finger->tare.held || (finger->present && bt_tare_touched(&finger->tare));
    }
    return in_use;
}

static void close_round(bt_gateway *gateway)
{
    bt_session *session = &gateway->session;
    uint8_t serial[BT_SERIAL_BYTES];
    bt_session_end_round(session);
    if (gateway->kept != NULL) {
        bt_kept_tares_note(gateway->kept, session, &gateway->kept_rounds);
    }
    for (unsigned f = 0; f < BT_MAX_FINGERS; f++) {
        if (gateway->queried >> f & 1) {
            if (bt_serial_query_answer(&gateway->sampler.query[f], serial)) {
                bt_sensors_answer(session, f, serial);
            }
            if (!session->finger[f].present) {
                gateway->sampler.query[f].form = BT_FORM_WORDS; // absent: do not cost the others a round
            }
        }
    }
    uint8_t ask = bt_sensors_to_ask(session);
    if (ask != 0) {
        (void)bt_sampler_ask(&gateway->sampler, ask, gateway->round + ASK_AHEAD_ROUNDS);
    }
    gateway->round_open = false;
    atomic_store_explicit(&gateway->in_use, is_in_use(session), memory_order_relaxed);
}

static void process_slot(bt_gateway *gateway, const bt_slot *slot)
{
    bt_session *session = &gateway->session;
    // A new round number closes the round before, even if that lost its last slots.
    if (gateway->round_open && slot->round != gateway->round) {
        close_round(gateway);
    }
    if (!gateway->round_open) {
        bt_session_begin(session, slot->t_us - slot->slot * 1000000u / BT_SLOT_HZ);
        gateway->round = slot->round;
        gateway->round_open = true;
        session->asked = slot->asked;
        gateway->queried = slot->queried;
    }
    uint16_t count[BT_MAX_FINGERS];
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        enum bt_word kind = bt_word_decode(slot->word[f], &count[f]);
        if (!(slot->asked >> f & 1)) {
            count_word(&session->finger[f].words, kind, slot->word[f]);
        }
    }
    bt_session_slot(session, slot->slot, count, slot->t_us);
    if (slot->slot == BT_SLOTS - 1) {
        close_round(gateway);
    }
}

// A hand must not drop an object because a program set an odd baud rate.
static bool may_leave(const bt_session *session)
{
    return bt_settings_get(&session->settings, BT_SETTING_LOADER_BY_TOUCH) != 0 && !is_in_use(session);
}

// One bufferful per turn: a host that floods a link must not starve the slots, or the other host.
static void read_link(bt_gateway *gateway, unsigned link)
{
    uint8_t bytes[64];
    const uint32_t turns = port_link_turns(gateway->port, link);
    if (turns != gateway->link_turns[link]) {
        gateway->link_turns[link] = turns;
        bt_session_link_down(&gateway->session, link);
        if (port_link_touched(gateway->port) && may_leave(&gateway->session)) {
            (void)port_reboot(gateway->port, true);
        }
    }
    const size_t n = port_link_read(gateway->port, link, bytes, sizeof bytes);
    if (n > 0) {
        bt_session_receive(&gateway->session, link, bytes, n, port_now_us(gateway->port));
        // A rate may have been saved by mistake, on a board without another link: until a frame decodes,
        // alternate between the saved and the default baud rate.
        gateway->doubtful_bytes += (uint32_t)n;
        if (gateway->session.status.rx_frames == 0 && gateway->doubtful_bytes >= DOUBTFUL_BYTES) {
            gateway->doubtful_bytes = 0;
            gateway->uart_by_default = !gateway->uart_by_default;
            start_uart(gateway);
        }
    }
}

void bt_gateway_poll(bt_gateway *gateway)
{
    bt_session *session = &gateway->session;
    for (unsigned link = 0; link < PORT_LINKS; link++) {
        read_link(gateway, link);
    }
    // At most a round's worth: a late main loop must still read the host and feed the watchdog.
    bt_slot slot;
    for (int k = 0; k < BT_SLOTS && bt_sampler_pop(&gateway->sampler, &slot); k++) {
        process_slot(gateway, &slot);
    }
    if (session->status.slots_late != gateway->sampler.late) {
        session->status.slots_late = gateway->sampler.late;
        session->status.faults |= BT_FAULT_FLAG_SLOTS_LATE;
    }
    if (gateway->dma_late != gateway->sampler.dma_late) {
        gateway->dma_late = gateway->sampler.dma_late;
        session->status.faults |= BT_FAULT_FLAG_SLOT_DMA_LATE;
    }
    bt_session_tick(session, port_now_us(gateway->port));
}
