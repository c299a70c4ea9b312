#include "talk/session.h"

#include <string.h>

void bt_session_init(bt_session *session, const bt_msg_hello *hello, bt_link_write write, void *context,
                     uint32_t now_us)
{
    memset(session, 0, sizeof *session);
    session->hello = *hello;
    session->hello.wire_major = BT_WIRE_MAJOR;
    session->hello.wire_minor = BT_WIRE_MINOR;
    session->hello.schema_hash = BT_SCHEMA_HASH;
    session->write = write;
    session->context = context;
    session->status_us = now_us;
    session->second_us = now_us;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger_reset(&session->finger[f], f);
        bt_finger_map_reset(&session->map[f]);
    }
    bt_settings_reset(&session->settings);
    bt_session_use_settings(session);
    session->owner = session->link = BT_NO_LINK;
}

// State of a calibration or map for the sensor with this serial number; NULL: there is none.
static uint8_t state_of(const uint8_t *made_for, const bt_sensor_info *info)
{
    if (made_for == NULL) {
        return BT_CALIBRATION_STATE_NONE;
    }
    return bt_serial_fits(made_for, info->serial) ? BT_CALIBRATION_STATE_IN_FORCE
                                                  : BT_CALIBRATION_STATE_OTHER_SENSOR;
}

static uint8_t calibration_state(const bt_session *session, int f)
{
    const bt_calibration *calibration = &session->calibration[f];
    return state_of(calibration->present ? calibration->serial : NULL, &session->info[f]);
}

static uint8_t map_state(const bt_session *session, int f)
{
    const bt_finger_map *map = &session->map[f];
    return state_of(map->place.bytes != 0 ? map->map.serial : NULL, &session->info[f]);
}

static void use_finger_settings(bt_session *session, int f)
{
    bt_settings own = session->settings;
    const bt_calibration *calibration = &session->calibration[f];
    const bt_finger_map *map = &session->map[f];
    session->calibration_state[f] = calibration_state(session, f);
    session->map_state[f] = map_state(session, f);
    if (session->calibration_state[f] == BT_CALIBRATION_STATE_IN_FORCE) {
        (void)bt_calibration_apply(calibration, &own); // the ranges were checked on arrival
    }
    session->solve[f] = bt_solve_settings_from(&own);
    session->solve[f].map = session->map_state[f] == BT_CALIBRATION_STATE_IN_FORCE ? &map->map : NULL;
    session->tare[f] = bt_tare_settings_from(&own);
    bt_pressure_use(&session->finger[f].pressure, &own);
}

void bt_session_use_settings(bt_session *session)
{
    const bt_settings *settings = &session->settings;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        use_finger_settings(session, f);
    }
    session->status_period_us = (uint32_t)bt_settings_get(settings, BT_SETTING_STATUS_PERIOD_MS) * 1000;
    session->hold_timeout_us = (uint32_t)bt_settings_get(settings, BT_SETTING_HOLD_TIMEOUT_MS) * 1000;
    session->idle_rounds = (uint16_t)(bt_settings_get(settings, BT_SETTING_IDLE_PERIOD_MS) / BT_FRAME_MS);
}

void bt_session_send_sealed(bt_session *session, uint8_t id, uint8_t *frame)
{
    size_t bytes = bt_frame_seal(id, (size_t)bt_wire_payload_bytes(id), frame);
    if (session->write(session->context, session->link, frame, bytes)) {
        session->status.messages_sent++;
    } else {
        session->status.messages_dropped++;
        session->status.faults |= BT_FAULT_FLAG_DROPPED;
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

void bt_session_end_trial(bt_session *session)
{
    if (session->bus_rate_overridden) {
        session->bus_rate_overridden = false;
        session->board.set_bus_rate(session->context, 0);
    }
}

void bt_session_stop(bt_session *session)
{
    session->status.streams = 0;
    session->keepalive_ms = 0;
    session->upload.open = false;
    session->other = session->refused = 0;
    bt_session_end_trial(session);
    bt_session_use_settings(session);
}

bool bt_session_is_owned(const bt_session *session)
{
    bool owned = session->keepalive_ms != 0;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        owned = owned || session->finger[f].tare.held;
    }
    return owned && session->owner != BT_NO_LINK;
}

void bt_session_sensor_changed(bt_session *session, unsigned f, bool other)
{
    if (session->status.streams == 0) {
        use_finger_settings(session, (int)f);
        return;
    }
    if (!other) {
        return; // first number since START: the calibration and map of START stay
    }
    uint8_t bit = (uint8_t)(1u << f);
    bool differs = calibration_state(session, (int)f) != session->calibration_state[f]
                   || map_state(session, (int)f) != session->map_state[f];
    session->other |= bit;
    session->refused = (uint8_t)((session->refused & ~bit) | (differs ? bit : 0));
}
