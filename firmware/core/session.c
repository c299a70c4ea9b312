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
    session->kernel = bt_kernel_settings_from(&session->settings);
    bt_deframer_reset(&session->deframer);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger_reset(&session->finger[f], f);
    }
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

void bt_session_round(bt_session *session)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_msg_frame frame;
        bt_msg_pac pac;
        bt_msg_tare tare;
        bool tare_changed;
        uint8_t payload[BT_FRAME_MAX_BYTES];
        if (!bt_finger_finish(&session->finger[f], &session->kernel, &frame, &pac, &tare, &tare_changed)) {
            if (session->finger[f].silent_rounds == BT_UNPLUGGED_ROUNDS) {
                memset(&session->info[f], 0, sizeof session->info[f]); // the next one may be another
            }
            continue;
        }
        if (!(session->fingers >> f & 1)) {
            continue;
        }
        if (session->streams & BT_STREAM_FLAG_FRAMES) {
            if (tare_changed) {
                bt_msg_tare_pack(&tare, payload);
                bt_session_send(session, BT_TARE_ID, payload);
            }
            bt_msg_frame_pack(&frame, payload);
            bt_session_send(session, BT_FRAME_ID, payload);
        }
        if (session->streams & BT_STREAM_FLAG_PAC) {
            bt_msg_pac_pack(&pac, payload);
            bt_session_send(session, BT_PAC_ID, payload);
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
        .noise_count2 = finger->tare.noise_count2,
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
        session->streams = 0;
        session->keepalive_ms = 0;
    }
    uint32_t period_us = (uint32_t)bt_settings_get(&session->settings, BT_SETTING_STATUS_PERIOD_MS) * 1000;
    if (now_us - session->status_us < period_us) {
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

void bt_session_link_down(bt_session *session)
{
    session->streams = 0;
    session->keepalive_ms = 0;
    bt_deframer_reset(&session->deframer);
}
