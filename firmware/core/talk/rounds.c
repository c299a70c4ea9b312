#include "talk/rounds.h"

#include "talk/sensors.h"
#include "talk/status.h"
#include "talk/streams.h"

void bt_session_begin(bt_session *session, uint32_t t_us)
{
    bt_streams_begin(session);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger_begin(&session->finger[f], t_us, &session->tare[f]);
    }
}

void bt_session_slot(bt_session *session, uint8_t slot, const uint16_t count[BT_MAX_FINGERS], uint32_t t_us)
{
    uint32_t touched = 0; // bit mask
    bt_sensors_slot(session, count);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (bt_finger_put(&session->finger[f], slot, count[f])) {
            touched |= 1u << f;
        }
    }
    if (touched | session->events_due[slot]) {
        bt_streams_slot(session, slot, touched, t_us);
    }
}

// Returns whether the finger's sensor answered in this round.
static bool end_finger(bt_session *session, unsigned f)
{
    bt_finger *finger = &session->finger[f];
    if (session->asked >> f & 1) {
        bt_finger_pass(finger);
        return false;
    }
    finger->sensor_flags = bt_sensors_flags(session, f);
    if (finger->answered) {
        bt_faults_of_round(session, f, finger->sensor_flags);
    }
    if (!bt_finger_end(finger, &session->tare[f])) {
        // Without a serial number, only the silence shows that another sensor may follow.
        if (finger->silent_rounds == BT_UNPLUGGED_ROUNDS && finger->answered && !session->info[f].present) {
            bt_finger_forget(finger);
        }
        return false;
    }
    bt_faults_of_round(session, f, bt_finger_flags(finger));
    return true;
}

void bt_session_end_round(bt_session *session)
{
    uint32_t answering = 0; // bit mask
    for (int k = 0; k < BT_MAX_FINGERS; k++) {
        const uint8_t f = bt_scheduler_finger(&session->scheduler, k);
        if (end_finger(session, f)) {
            answering |= 1u << f;
            bt_streams_frame(session, &session->finger[f]);
        }
    }
    bt_scheduler_end(&session->scheduler);
    // Vibration follows the forces of all fingers: a controller that closes a grip waits for forces.
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (answering >> f & 1) {
            bt_streams_vibration(session, &session->finger[f]);
        }
    }
}
