#include "talk/streams.h"

#include "talk/sensors.h"
#include "talk/status.h"

#include <string.h>

static bool streams(const bt_session *session, const bt_finger *finger, uint8_t stream)
{
    return (session->status.streams & stream) && (session->fingers >> finger->index & 1);
}

// A finger that starts to send events has no history, and one that stops has no slip level.
void bt_streams_begin(bt_session *session)
{
    static const uint8_t pac_slot[] = BT_FINGER_EVENT_SLOTS;
    const uint8_t before = session->event_fingers;
    uint8_t now = 0;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        const bool asked = session->finger[f].quantities & BT_QUANTITY_FLAG_EVENTS;
        now = (uint8_t)(now | asked << f);
    }
    const bool streaming = session->status.streams & (BT_STREAM_FLAG_FRAMES | BT_STREAM_FLAG_PAC);
    now = streaming ? now & session->fingers : 0;
    if (now == before) {
        return;
    }
    session->event_fingers = now;
    memset(session->events_due, 0, sizeof session->events_due);
    for (size_t k = 0; k < sizeof pac_slot; k++) {
        session->events_due[pac_slot[k]] = now;
    }
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_events *events = &session->finger[f].events;
        if ((now ^ before) & 1 << f) {
            bt_events_reset(events);
        } else if (now >> f & 1 && events->strongest_slot != BT_EVENTS_NO_SLOT) {
            session->events_due[events->strongest_slot] |= (uint8_t)(1u << f);
        }
    }
}

static void send_touch(bt_session *session, const bt_finger *finger, uint8_t slot, uint32_t t_us)
{
    if (!streams(session, finger, BT_STREAM_FLAG_FRAMES) || !(finger->quantities & BT_QUANTITY_FLAG_TOUCH)) {
        return;
    }
    bt_msg_touch msg = {
        .seq = finger->seq,
        .t_us = t_us,
        .finger = finger->index,
        .slot = session->hello.slot_hz == 0 ? BT_SLOT_UNKNOWN : slot,
        .energy_count2 = bt_trigger_energy(&finger->tare.trigger),
    };
    bt_msg_touch_send(session, &msg);
}

static void send_event(bt_session *session, bt_finger *finger, uint8_t event, uint8_t slot, uint32_t t_us)
{
    bt_msg_event msg;
    bt_finger_event(finger, event, slot, t_us, &msg);
    msg.slot = session->hello.slot_hz == 0 ? BT_SLOT_UNKNOWN : slot;
    bt_msg_event_send(session, &msg);
}

static void move_due(bt_session *session, uint8_t finger, uint8_t before, uint8_t now)
{
    const uint8_t bit = (uint8_t)(1u << finger);
    if (before != BT_EVENTS_NO_SLOT) {
        session->events_due[before] &= (uint8_t)~bit;
    }
    if (now != BT_EVENTS_NO_SLOT) {
        session->events_due[now] |= bit;
    }
}

static void send_events(bt_session *session, uint8_t slot, uint32_t due, uint32_t touched, uint32_t t_us)
{
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (!(due >> f & 1)) {
            continue;
        }
        bt_finger *finger = &session->finger[f];
        uint8_t before = finger->events.strongest_slot;
        uint32_t events = bt_finger_events(finger, slot, touched >> f & 1);
        if (finger->events.strongest_slot != before) {
            move_due(session, f, before, finger->events.strongest_slot);
        }
        for (uint8_t event = 0; events != 0; event++, events >>= 1) {
            if (events & 1) {
                send_event(session, finger, event, slot, t_us);
            }
        }
    }
}

void bt_streams_slot(bt_session *session, uint8_t slot, uint32_t touched, uint32_t t_us)
{
    for (int f = 0; touched >> f != 0; f++) {
        if (touched >> f & 1) {
            send_touch(session, &session->finger[f], slot, t_us);
        }
    }
    uint32_t due = session->events_due[slot] | (touched & session->event_fingers);
    if (due) {
        send_events(session, slot, due, touched, t_us);
    }
}

static void send_idle(bt_session *session, bt_finger *finger, bool frame_follows)
{
    bt_msg_idle msg;
    bt_finger_idle_message(finger, frame_follows, &msg);
    bt_msg_idle_send(session, &msg);
    finger->unsent = 0;
}

static void count_skips(bt_msg_status *status, uint32_t quantities)
{
    // A torque needs a point and a force: they are computed, though not sent.
    bool torque = quantities & BT_QUANTITY_FLAG_TORQUE;
    status->poc_skipped += !(torque || quantities & BT_QUANTITY_FLAG_POC);
    status->force_skipped += !(torque || quantities & BT_QUANTITY_FLAG_FORCE);
    status->torque_skipped += !torque;
}

// Time since the end of the round's last slot. With a stopped clock, no round is late.
static int32_t late_us(const bt_session *session, const bt_finger *finger)
{
    if (session->board.now_us == NULL) {
        return 0;
    }
    return (int32_t)(session->board.now_us(session->context) - (finger->round.t_us + BT_FRAME_MS * 1000));
}

static void send_frame(bt_session *session, bt_finger *finger)
{
    _Alignas(4) uint16_t frame[(BT_ENCODED_MAX_BYTES + 1) / 2];
    bt_msg_frame msg;
    if (finger->tare_unsent) {
        bt_msg_tare tare;
        bt_finger_tare(finger, &tare);
        bt_msg_tare_send(session, &tare);
    }
    const bt_solve_settings *solve = &session->solve[finger->index];
    uint32_t shed = bt_scheduler_shed(&session->scheduler, finger->index, late_us(session, finger),
                                      bt_finger_wrench_age(finger, solve) <= BT_REPEAT_MAX_ROUNDS);
    if (shed & BT_SHED_FRAME) {
        session->status.frames_shed++;
        finger->shed = true;
        return;
    }
    session->status.wrench_repeated += shed == BT_SHED_MAP;
    uint8_t quantities = session->refused >> finger->index & 1 ? 0 : finger->quantities;
    bt_finger_frame(finger, solve, quantities, shed, &msg);
    bt_faults_of_round(session, finger->index, msg.flags);
    bt_msg_frame_pack_even(&msg, frame + BT_PAYLOAD_AT / 2);
    bt_session_send_sealed(session, BT_FRAME_ID, (uint8_t *)frame);
    count_skips(&session->status, finger->quantities);
}

// At the end of a round; the message gives the last slot as the time of the change.
static void report_trust(bt_session *session, bt_finger *finger)
{
    const uint8_t slot = BT_SLOTS - 1;
    if (session->event_fingers >> finger->index & 1 && bt_finger_trust_changed(finger)) {
        send_event(session, finger, BT_EVENT_KIND_TRUST, slot,
                   finger->round.t_us + slot * 1000000u / BT_SLOT_HZ);
    }
}

// Send a FRAME, or count the round for an IDLE. An IDLE is sent at the end of its period and before the next
// FRAME, so that every round is accounted for and a gap is a loss.
void bt_streams_frame(bt_session *session, bt_finger *finger)
{
    if (!streams(session, finger, BT_STREAM_FLAG_FRAMES)) {
        return;
    }
    bool idle = bt_finger_idle(finger) && !finger->fresh;
    if (idle && finger->unsent + 1 >= session->idle_rounds) {
        idle = !bt_finger_moved(finger);
    }
    if (!idle) {
        if (finger->unsent > 0) {
            send_idle(session, finger, true);
        }
        finger->kept.valid = finger->kept.valid && !finger->fresh;
        send_frame(session, finger);
        finger->trust_reported = finger->fresh ? finger->trust : finger->trust_reported;
        finger->fresh = false;
        report_trust(session, finger);
        return;
    }
    finger->kept.valid = false; // seq counts a wrench's age up to 655 s only; a rest may last longer
    finger->trust = bt_trust(bt_finger_flags(finger), 0, 0);
    report_trust(session, finger);
    session->status.frames_idle++;
    count_skips(&session->status, 0);
    if (++finger->unsent >= session->idle_rounds) {
        send_idle(session, finger, false);
    }
}

void bt_streams_vibration(bt_session *session, bt_finger *finger)
{
    if (streams(session, finger, BT_STREAM_FLAG_PAC)) {
        bt_msg_pac pac;
        bt_finger_pac(finger, &pac);
        bt_msg_pac_send(session, &pac);
    }
}
