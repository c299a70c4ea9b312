#include "talk/host_link.h"

#include "talk/commands.h"
#include "talk/status.h"

static void damaged(bt_session *session)
{
    session->status.rx_errors++;
    session->status.faults |= BT_FAULT_FLAG_LINK_DAMAGED;
}

void bt_session_receive(bt_session *session, unsigned link, const uint8_t *data, size_t bytes,
                        uint32_t now_us)
{
    bt_deframer *deframer = &session->deframer[link];
    session->link = (uint8_t)link;
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(deframer, data[k]);
        if (outcome == BT_DEFRAMED_GOOD) {
            session->status.rx_frames++;
            bool empty = deframer->payload_bytes == 0; // the id is unknown; there is no req_id
            bt_command(session, deframer->id, empty ? NULL : deframer->buffer + 1, now_us);
        } else if (outcome == BT_DEFRAMED_BAD_LENGTH) {
            // The CRC is right, so a host sent this on purpose: bt_command answers with an error.
            damaged(session);
            bt_command(session, deframer->id, NULL, now_us);
        } else if (outcome != BT_DEFRAMED_NOTHING) {
            damaged(session);
        }
    }
    session->link = session->owner;
}

// A lost controller's holds lapse after a while; the fingers' signals then decide about contact again.
static void lapse_holds(bt_session *session, uint32_t now_us)
{
    // A streaming host may stay silent for the keep-alive, and without limit in lock-step.
    const bool streams = session->status.streams != 0;
    const uint32_t allowed_us = streams ? session->keepalive_ms * 1000u : 0;
    const uint32_t timeout_us = allowed_us > session->hold_timeout_us ? allowed_us : session->hold_timeout_us;
    if (session->hold_timeout_us == 0 || (streams && allowed_us == 0)
        || now_us - session->owner_rx_us <= timeout_us) {
        return;
    }
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (session->finger[f].tare.held) {
            bt_tare_lapse(&session->finger[f].tare);
            session->status.faults |= BT_FAULT_FLAG_HOLD_LAPSED;
        }
    }
}

void bt_session_tick(bt_session *session, uint32_t now_us)
{
    while (now_us - session->second_us >= 1000000) {
        session->second_us += 1000000;
        session->status.uptime_s++;
    }
    if (session->keepalive_ms != 0 && now_us - session->owner_rx_us > session->keepalive_ms * 1000u) {
        session->status.faults |= session->status.streams != 0 ? BT_FAULT_FLAG_HOST_SILENT : 0;
        bt_session_stop(session);
    }
    lapse_holds(session, now_us);
    if (now_us - session->status_us < session->status_period_us) {
        return;
    }
    session->status_us = now_us;
    if (session->status.streams & BT_STREAM_FLAG_STATUS) {
        bt_session_send_status(session, 0, now_us);
        for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
            if (session->finger[f].present) {
                bt_session_send_sensor_status(session, 0, f, now_us);
            }
        }
    }
}

void bt_session_link_down(bt_session *session, unsigned link)
{
    bt_deframer_reset(&session->deframer[link]);
    if (session->owner == link) {
        bt_session_stop(session);
        session->owner = session->link = BT_NO_LINK;
    }
}
