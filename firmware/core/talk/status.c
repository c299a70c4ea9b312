#include "talk/status.h"

void bt_session_send_status(bt_session *session, uint8_t req_id, uint32_t now_us)
{
    bt_msg_status *msg = &session->status;
    msg->t_us = now_us;
    msg->req_id = req_id;
    msg->fingers_present = bt_session_present(session);
    bt_msg_status_send(session, msg);
    msg->seq++;
}

// Fault of the electrode that went out last; of several railed or missing ones, the first.
static uint8_t electrode_fault(const bt_finger *finger)
{
    uint32_t without = finger->tare.trigger.without;
    if (finger->health.out != 0 || without == 0) {
        return finger->health.electrode_fault;
    }
    int first = __builtin_ctz(without);
    return bt_count_railed(finger->round.electrode[first]) ? BT_SENSOR_FAULT_RAILED : BT_SENSOR_FAULT_MISSING;
}

void bt_session_send_sensor_status(bt_session *session, uint8_t req_id, uint8_t index, uint32_t now_us)
{
    const bt_finger *finger = &session->finger[index];
    bt_msg_sensor_status msg = {
        .seq = session->sensor_status_seq++,
        .t_us = now_us,
        .req_id = req_id,
        .finger = index,
        .present = finger->present,
        .tare_state = finger->tare.state,
        .tare_reason = finger->tare.reason,
        .tare_age_ms = finger->tare.age_rounds * BT_FRAME_MS,
        .noise_count2 = finger->tare.noise.count2,
        .words_good = finger->words.good,
        .words_stuck = finger->words.stuck,
        .words_error = finger->words.error,
        .words_parity = finger->words.parity,
        .last_error_word = finger->words.last_error_word,
        .electrodes_out = finger->tare.trigger.without,
        .electrode_fault = electrode_fault(finger),
        .sensor_fault = bt_finger_sensor_fault(finger),
    };
    bt_msg_sensor_status_send(session, &msg);
}

void bt_faults_of_round(bt_session *session, unsigned f, uint32_t flags)
{
    // A finger is untared in any case before the first tare.
    const bool tared = session->finger[f].tare.reason != BT_TARE_REASON_NONE;
    const uint32_t against = BT_TRUST_FLAGS_LATCHED | (tared ? BT_FRAME_FLAG_UNTARED : 0);
    session->status.finger_faults[f] |= flags & against;
}
