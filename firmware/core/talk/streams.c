#include "talk/streams.h"

#include "talk/faults.h"
#include "talk/sensors.h"

#include <string.h>

// How long after its round's last slot a finger's FRAME may begin before something is left out. At full load
// the last of five begins 8 ms late; slots are buffered for 29 ms (BT_SLOT_RING).
#define SIGMA_LATE_US      9000
#define MAP_LATE_US        11000
#define FRAME_LATE_US      22000
#define SIGMA_PAUSE_ROUNDS 50 // for all fingers, or the first ones' sigmas would cost the last ones even more

static bool streams(const bt_session *session, const bt_finger *finger, uint8_t what)
{
    return (session->streams & what) && (session->fingers >> finger->index & 1);
}

// A finger that starts sending events starts without a history.
static void begin_events(bt_session *session)
{
    static const uint8_t pac_slot[] = BT_FINGER_EVENT_SLOTS;
    const uint8_t before = session->event_fingers;
    uint8_t now = 0;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        const bool asked = session->finger[f].quantities & BT_QUANTITY_FLAG_EVENTS;
        now = (uint8_t)(now | asked << f);
    }
    const bool streaming = session->streams & (BT_STREAM_FLAG_FRAMES | BT_STREAM_FLAG_PAC);
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
        if (now & ~before & 1 << f) {
            bt_events_reset(events);
        } else if (now >> f & 1 && events->watched != BT_EVENTS_NO_SLOT) {
            session->events_due[events->watched] |= (uint8_t)(1u << f);
        }
    }
}

void bt_session_begin(bt_session *session, uint32_t t_us)
{
    begin_events(session);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger_begin(&session->finger[f], t_us, &session->tare[f]);
    }
}

static void send_touch(bt_session *session, const bt_finger *finger, uint8_t slot, uint32_t t_us)
{
    uint8_t payload[BT_TOUCH_BYTES];
    if (!streams(session, finger, BT_STREAM_FLAG_FRAMES) || !(finger->quantities & BT_QUANTITY_FLAG_TOUCH)) {
        return;
    }
    bt_msg_touch msg = {
        .seq = finger->seq,
        .t_us = t_us,
        .finger = finger->index,
        .slot = slot,
        .energy_count2 = bt_trigger_energy(&finger->tare.trigger),
    };
    bt_msg_touch_pack(&msg, payload);
    bt_session_send(session, BT_TOUCH_ID, payload);
}

static void send_event(bt_session *session, bt_finger *finger, uint8_t event, uint8_t slot, uint32_t t_us)
{
    uint8_t payload[BT_EVENT_BYTES];
    bt_msg_event msg;
    bt_finger_event(finger, event, slot, t_us, &msg);
    bt_msg_event_pack(&msg, payload);
    bt_session_send(session, BT_EVENT_ID, payload);
}

static void watch(bt_session *session, uint8_t finger, uint8_t before, uint8_t now)
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
        uint8_t watched = finger->events.watched;
        uint32_t told = bt_finger_events(finger, slot, touched >> f & 1);
        if (finger->events.watched != watched) {
            watch(session, f, watched, finger->events.watched);
        }
        for (uint8_t event = 0; told != 0; event++, told >>= 1) {
            if (told & 1) {
                send_event(session, finger, event, slot, t_us);
            }
        }
    }
}

void bt_session_slot(bt_session *session, uint8_t slot, const uint16_t count[BT_MAX_FINGERS], uint32_t t_us)
{
    uint32_t touched = 0; // bit mask
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_sensors_word(session, (unsigned)f, count[f] != BT_INVALID_COUNT);
        if (bt_finger_put(&session->finger[f], slot, count[f])) {
            touched |= 1u << f;
            send_touch(session, &session->finger[f], slot, t_us);
        }
    }
    uint32_t due = session->events_due[slot] | (touched & session->event_fingers);
    if (due) {
        send_events(session, slot, due, touched, t_us);
    }
}

static void send_tare(bt_session *session, const bt_finger *finger)
{
    uint8_t payload[BT_TARE_BYTES];
    bt_msg_tare msg;
    bt_finger_tare(finger, &msg);
    bt_msg_tare_pack(&msg, payload);
    bt_session_send(session, BT_TARE_ID, payload);
}

static void send_idle(bt_session *session, bt_finger *finger, bool frame_follows)
{
    uint8_t payload[BT_IDLE_BYTES];
    bt_msg_idle msg;
    bt_finger_idle_message(finger, frame_follows, &msg);
    msg.flags |= bt_sensors_flags(session, finger->index);
    bt_msg_idle_pack(&msg, payload);
    bt_session_send(session, BT_IDLE_ID, payload);
    finger->unsent = 0;
}

static void count_skips(bt_skip_counts *skips, uint32_t quantities)
{
    // Torque x needs a point and a force: they are computed for it, though not sent.
    bool torque = quantities & BT_QUANTITY_FLAG_TORQUE;
    skips->poc += !(torque || quantities & BT_QUANTITY_FLAG_POC);
    skips->force += !(torque || quantities & BT_QUANTITY_FLAG_FORCE);
    skips->torque += !torque;
    skips->sigma += !(quantities & BT_QUANTITY_FLAG_SIGMA);
}

// How long ago the round's last slot ended. By a clock that stands still, a round that has not ended is not
// late.
static int32_t late_us(const bt_session *session, const bt_finger *finger)
{
    if (session->board.now_us == NULL) {
        return 0;
    }
    return (int32_t)(session->board.now_us() - (finger->round.t_us + BT_FRAME_MS * 1000));
}

static uint32_t to_shed(bt_session *session, const bt_finger *finger, int32_t late)
{
    uint32_t age = bt_finger_wrench_age(finger, &session->solve[finger->index]);
    if (late > SIGMA_LATE_US) {
        session->sigma_pause = SIGMA_PAUSE_ROUNDS;
    }
    return (session->sigma_pause > 0 ? BT_SHED_SIGMA : 0)
           | (late > MAP_LATE_US && age <= BT_REPEAT_MAX_ROUNDS ? BT_SHED_MAP : 0);
}

// The first finger for which something is left out comes first in the next round.
static void went_without(bt_session *session, uint8_t finger)
{
    if (session->first_next == BT_MAX_FINGERS) {
        session->first_next = finger;
    }
}

static void send_frame(bt_session *session, bt_finger *finger)
{
    _Alignas(4) uint16_t frame[(BT_ENCODED_MAX_BYTES + 1) / 2];
    bt_msg_frame msg;
    if (finger->tare_unsent) {
        send_tare(session, finger);
    }
    int32_t late = late_us(session, finger);
    if (late > FRAME_LATE_US) {
        finger->shed = true;
        session->sheds.frames++;
        went_without(session, finger->index);
        return;
    }
    uint32_t shed = to_shed(session, finger, late);
    session->sheds.sigma += shed & BT_SHED_SIGMA && finger->quantities & BT_QUANTITY_FLAG_SIGMA;
    if (shed & BT_SHED_MAP) {
        session->sheds.wrench++;
        went_without(session, finger->index);
    }
    uint8_t quantities = finger->quantities;
    finger->quantities = bt_sensors_refused(session, finger->index) ? 0 : quantities;
    bt_finger_frame(finger, &session->solve[finger->index], shed, &msg);
    finger->quantities = quantities;
    msg.flags |= bt_sensors_flags(session, finger->index);
    bt_faults_of_round(session, finger->index, msg.flags);
    bt_msg_frame_pack_even(&msg, frame + BT_PAYLOAD_AT / 2);
    bt_session_send_sealed(session, BT_FRAME_ID, (uint8_t *)frame);
    count_skips(&session->skips, finger->quantities);
}

// Send a FRAME, or count the round for an IDLE. An IDLE is sent when its period is over and before the next
// FRAME, so that every round is accounted for and a gap is a loss.
static void send_round(bt_session *session, bt_finger *finger)
{
    bool idle = bt_finger_idle(finger) && !finger->fresh;
    if (idle && finger->unsent + 1 >= session->idle_rounds) {
        idle = !bt_finger_moved(finger);
    }
    if (!idle) {
        if (finger->unsent > 0) {
            send_idle(session, finger, true);
        }
        finger->kept.valid = finger->kept.valid && !finger->fresh;
        finger->fresh = false;
        send_frame(session, finger);
        return;
    }
    session->skips.frames++;
    count_skips(&session->skips, 0);
    if (++finger->unsent >= session->idle_rounds) {
        send_idle(session, finger, false);
    }
}

static void send_pac(bt_session *session, const bt_finger *finger)
{
    uint8_t payload[BT_PAC_BYTES];
    bt_msg_pac msg;
    bt_finger_pac(finger, &msg);
    bt_msg_pac_pack(&msg, payload);
    bt_session_send(session, BT_PAC_ID, payload);
}

static void send_bands(bt_session *session, bt_finger *finger)
{
    uint8_t payload[BT_BANDS_BYTES];
    bt_msg_bands msg;
    bt_finger_bands(finger, &msg);
    bt_msg_bands_pack(&msg, payload);
    bt_session_send(session, BT_BANDS_ID, payload);
}

void bt_session_end_round(bt_session *session)
{
    uint32_t answering = 0; // bit mask
    const int first = session->first;
    session->first_next = BT_MAX_FINGERS;
    session->sigma_pause = (uint8_t)(session->sigma_pause - (session->sigma_pause > 0));
    for (int k = 0; k < BT_MAX_FINGERS; k++) {
        const int f = first + k < BT_MAX_FINGERS ? first + k : first + k - BT_MAX_FINGERS;
        bt_finger *finger = &session->finger[f];
        if (session->asked >> f & 1) {
            bt_finger_pass(finger);
            continue;
        }
        if (finger->answered) {
            bt_faults_of_round(session, (unsigned)f, bt_sensors_flags(session, (unsigned)f));
        }
        if (!bt_finger_end(finger, &session->tare[f])) {
            // Without a serial number, only the silence shows that another sensor may come.
            if (finger->silent_rounds == BT_UNPLUGGED_ROUNDS && finger->answered
                && !session->info[f].present) {
                bt_finger_forget(finger);
            }
            continue;
        }
        bt_faults_of_round(session, (unsigned)f, bt_channel_flags(&finger->round, &finger->tare));
        answering |= 1u << f;
        if (streams(session, finger, BT_STREAM_FLAG_FRAMES)) {
            send_round(session, finger);
        }
    }
    session->first = (uint8_t)(session->first_next % BT_MAX_FINGERS);
    // Vibration after the forces of all fingers, as a controller closing a grip waits for those.
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger *finger = &session->finger[f];
        if (!(answering >> f & 1)) {
            continue;
        }
        if (streams(session, finger, BT_STREAM_FLAG_PAC)) {
            send_pac(session, finger);
        }
        if (streams(session, finger, BT_STREAM_FLAG_BANDS)) {
            send_bands(session, finger);
        }
    }
}
