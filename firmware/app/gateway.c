#include "gateway.h"

#include "port.h"
#include "sampler.h"
#include "talk/host_link.h"
#include "talk/rounds.h"
#include "talk/sensors.h"
#include "word.h"

_Static_assert(PORT_LINKS == BT_LINKS, "the session has a deframer for every link");

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
static bool may_reboot(const bt_session *session)
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
        if (port_link_touched(gateway->port) && may_reboot(&gateway->session)) {
            (void)port_reboot(gateway->port, true);
        }
    }
    const size_t n = port_link_read(gateway->port, link, bytes, sizeof bytes);
    if (n > 0) {
        bt_session_receive(&gateway->session, link, bytes, n, port_now_us(gateway->port));
        bt_uart_received(&gateway->uart, gateway->port, &gateway->session, n);
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
