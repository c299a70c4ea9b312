#include "session.h"

#include <string.h>

void bt_session_init(bt_session *session, const bt_identity *identity, bt_link_write write, uint32_t now_us)
{
    memset(session, 0, sizeof *session);
    session->identity = *identity;
    session->write = write;
    session->status_us = now_us;
    session->second_us = now_us;
    bt_settings_reset(&session->settings);
    bt_session_use_settings(session);
    bt_deframer_reset(&session->deframer);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger_reset(&session->finger[f], f);
        bt_finger_map_reset(&session->map[f]);
    }
}

void bt_session_use_board(bt_session *session, const bt_board_actions *actions)
{
    session->board = *actions;
}

// Of what was made for the sensor of this serial number; NULL: there is nothing.
static uint8_t state_of(const uint8_t *made_for, const bt_sensor_info *info)
{
    if (made_for == NULL) {
        return BT_CALIBRATION_STATE_NONE;
    }
    return bt_serial_fits(made_for, info->serial) ? BT_CALIBRATION_STATE_IN_FORCE
                                                  : BT_CALIBRATION_STATE_OTHER_SENSOR;
}

static void use_finger_settings(bt_session *session, int f)
{
    bt_settings own = session->settings;
    const bt_calibration *calibration = &session->calibration[f];
    const bt_finger_map *map = &session->map[f];
    session->calibration_state[f] =
        state_of(calibration->present ? calibration->serial : NULL, &session->info[f]);
    session->map_state[f] = state_of(map->place.bytes != 0 ? map->map.serial : NULL, &session->info[f]);
    if (session->calibration_state[f] == BT_CALIBRATION_STATE_IN_FORCE) {
        (void)bt_calibration_apply(calibration, &own); // its ranges were seen to when it came
    }
    session->kernel[f] = bt_kernel_settings_from(&own);
    session->kernel[f].map = session->map_state[f] == BT_CALIBRATION_STATE_IN_FORCE ? &map->map : NULL;
    session->tare[f] = bt_tare_settings_from(&own);
}

void bt_session_use_settings(bt_session *session)
{
    const bt_settings *settings = &session->settings;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        use_finger_settings(session, f);
    }
    session->status_period_us = (uint32_t)bt_settings_get(settings, BT_SETTING_STATUS_PERIOD_MS) * 1000;
    session->idle_rounds = (uint16_t)(bt_settings_get(settings, BT_SETTING_IDLE_PERIOD_MS) / BT_FRAME_MS);
}

void bt_session_send(bt_session *session, uint8_t id, const uint8_t *payload)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES];
    size_t bytes = bt_frame_encode(id, payload, (size_t)bt_wire_payload_bytes(id), encoded);
    if (session->write(encoded, bytes)) {
        session->messages_sent++;
    } else {
        session->messages_dropped++;
    }
}

void bt_session_receive(bt_session *session, const uint8_t *data, size_t bytes, uint32_t now_us)
{
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&session->deframer, data[k]);
        if (outcome == BT_DEFRAMED_GOOD) {
            session->rx_frames++;
            bool empty = session->deframer.payload_bytes == 0; // of an unknown id; no req_id in it
            bt_command(session, session->deframer.id, empty ? NULL : session->deframer.buffer + 1, now_us);
        } else if (outcome == BT_DEFRAMED_BAD_LENGTH) {
            // The CRC is right, so somebody meant this: bt_command answers it in words.
            session->rx_errors++;
            bt_command(session, session->deframer.id, NULL, now_us);
        } else if (outcome != BT_DEFRAMED_NOTHING) {
            session->rx_errors++;
        }
    }
}

uint8_t bt_session_present(const bt_session *session)
{
    uint8_t mask = 0;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        mask = (uint8_t)(mask | session->finger[f].present << f);
    }
    return mask;
}

// ---- streams --------------------------------------------------------------------------------

static bool streams(const bt_session *session, const bt_finger *finger, uint8_t what)
{
    return (session->streams & what) && (session->fingers >> finger->index & 1);
}

void bt_session_begin(bt_session *session, uint32_t t_us)
{
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
        .energy_count2 = bt_gate_energy(&finger->tare.gate),
    };
    bt_msg_touch_pack(&msg, payload);
    bt_session_send(session, BT_TOUCH_ID, payload);
}

void bt_session_slot(bt_session *session, uint8_t slot, const uint16_t count[BT_MAX_FINGERS], uint32_t t_us)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (bt_finger_put(&session->finger[f], slot, count[f])) {
            send_touch(session, &session->finger[f], slot, t_us);
        }
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
    bt_msg_idle_pack(&msg, payload);
    bt_session_send(session, BT_IDLE_ID, payload);
    finger->unsent = 0;
}

static void count_skips(bt_skips *skips, uint32_t quantities)
{
    // Torque x needs a point and a force: they are computed for it, though not sent.
    bool torque = quantities & BT_QUANTITY_FLAG_TORQUE;
    skips->poc += !(torque || quantities & BT_QUANTITY_FLAG_POC);
    skips->force += !(torque || quantities & BT_QUANTITY_FLAG_FORCE);
    skips->torque += !torque;
    skips->sigma += !(quantities & BT_QUANTITY_FLAG_SIGMA);
}

static void send_frame(bt_session *session, bt_finger *finger)
{
    uint8_t payload[BT_FRAME_BYTES];
    bt_msg_frame msg;
    if (finger->tare_unsent) {
        send_tare(session, finger);
    }
    bt_finger_frame(finger, &session->kernel[finger->index], &msg);
    bt_msg_frame_pack(&msg, payload);
    bt_session_send(session, BT_FRAME_ID, payload);
    count_skips(&session->skips, finger->quantities);
}

// A FRAME, or the silence that an IDLE ends: when its period is over, and before the next FRAME, so that
// every round is accounted for and a gap is a loss.
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

static void forget_sensor(bt_session *session, int f)
{
    if (session->info[f].present) {
        memset(&session->info[f], 0, sizeof session->info[f]);
        if (session->streams == 0) {
            use_finger_settings(session, f);
        }
    }
}

void bt_session_round(bt_session *session)
{
    uint32_t answering = 0; // bit mask
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger *finger = &session->finger[f];
        if (!bt_finger_end(finger, &session->tare[f])) {
            if (finger->silent_rounds == BT_UNPLUGGED_ROUNDS) {
                forget_sensor(session, f); // the next one may be another
            }
            continue;
        }
        answering |= 1u << f;
        if (streams(session, finger, BT_STREAM_FLAG_FRAMES)) {
            send_round(session, finger);
        }
    }
    // Vibration after all fingers' forces: who closes a grip waits for those.
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (answering >> f & 1 && streams(session, &session->finger[f], BT_STREAM_FLAG_PAC)) {
            send_pac(session, &session->finger[f]);
        }
    }
}

void bt_session_send_status(bt_session *session, uint8_t req_id, uint32_t now_us)
{
    uint8_t payload[BT_STATUS_BYTES];
    bt_msg_status msg = {
        .seq = session->status_seq++,
        .t_us = now_us,
        .req_id = req_id,
        .uptime_s = session->uptime_s,
        .fingers_present = bt_session_present(session),
        .streams = session->streams,
        .messages_sent = session->messages_sent,
        .messages_dropped = session->messages_dropped,
        .slots_late = session->slots_late,
        .rx_frames = session->rx_frames,
        .rx_errors = session->rx_errors,
        .frames_idle = session->skips.frames,
        .poc_skipped = session->skips.poc,
        .force_skipped = session->skips.force,
        .torque_skipped = session->skips.torque,
        .sigma_skipped = session->skips.sigma,
    };
    bt_msg_status_pack(&msg, payload);
    bt_session_send(session, BT_STATUS_ID, payload);
}

void bt_session_send_sensor_status(bt_session *session, uint8_t req_id, uint8_t index, uint32_t now_us)
{
    uint8_t payload[BT_SENSOR_STATUS_BYTES];
    const bt_finger *finger = &session->finger[index];
    bt_msg_sensor_status msg = {
        .seq = session->sensor_status_seq++,
        .t_us = now_us,
        .req_id = req_id,
        .finger = index,
        .present = finger->present,
        .tare_state = finger->tare.state,
        .tare_reason = finger->tare.reason,
        .tare_age_ms = finger->tare.age_frames * BT_FRAME_MS,
        .noise_count2 = finger->tare.noise.count2,
        .words_good = finger->words.good,
        .words_stuck = finger->words.stuck,
        .words_error = finger->words.error,
        .words_parity = finger->words.parity,
        .last_error_word = finger->words.last_error_word,
    };
    bt_msg_sensor_status_pack(&msg, payload);
    bt_session_send(session, BT_SENSOR_STATUS_ID, payload);
}

void bt_session_tick(bt_session *session, uint32_t now_us)
{
    while (now_us - session->second_us >= 1000000) {
        session->second_us += 1000000;
        session->uptime_s++;
    }
    if (session->keepalive_ms != 0 && now_us - session->heard_us > session->keepalive_ms * 1000u) {
        bt_session_stop(session);
    }
    if (now_us - session->status_us < session->status_period_us) {
        return;
    }
    session->status_us = now_us;
    if (session->streams & BT_STREAM_FLAG_STATUS) {
        bt_session_send_status(session, 0, now_us);
        for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
            if (session->finger[f].present) {
                bt_session_send_sensor_status(session, 0, f, now_us);
            }
        }
    }
}

void bt_session_stop(bt_session *session)
{
    session->streams = 0;
    session->keepalive_ms = 0;
    session->upload.open = false;
    bt_session_use_settings(session);
}

void bt_session_link_down(bt_session *session)
{
    bt_session_stop(session);
    bt_deframer_reset(&session->deframer);
}
