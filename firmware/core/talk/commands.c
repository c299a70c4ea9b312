#include "talk/commands.h"

#include "talk/faults.h"
#include "talk/map_commands.h"
#include "talk/sensors.h"
#include "talk/status.h"

#include <string.h>

static void reply(bt_session *session, uint8_t req_id, uint8_t command, uint8_t error)
{
    uint8_t payload[BT_REPLY_BYTES];
    bt_msg_reply msg = {.req_id = req_id, .command = command, .error = error};
    bt_msg_reply_pack(&msg, payload);
    bt_session_send(session, BT_REPLY_ID, payload);
}

static void hello(bt_session *session, const uint8_t *payload)
{
    uint8_t out[BT_HELLO_BYTES];
    const bt_identity *identity = &session->identity;
    bt_msg_hello_request request;
    bt_msg_hello_request_unpack(&request, payload);
    bt_msg_hello msg = {
        .req_id = request.req_id,
        .nonce = request.nonce,
        .wire_major = BT_WIRE_MAJOR,
        .wire_minor = BT_WIRE_MINOR,
        .schema_hash = BT_SCHEMA_HASH,
        .firmware_major = identity->firmware_version[0],
        .firmware_minor = identity->firmware_version[1],
        .firmware_patch = identity->firmware_version[2],
        .board = identity->board,
        .boot_id = identity->boot_id,
        .slot_hz = BT_SLOT_HZ,
        .fingers_present = bt_session_present(session),
        .image_crc32 = identity->image_crc32,
    };
    memcpy(msg.board_serial, identity->board_serial, sizeof msg.board_serial);
    bt_msg_hello_pack(&msg, out);
    bt_session_send(session, BT_HELLO_ID, out);
}

static uint8_t start(bt_session *session, const uint8_t *payload)
{
    bt_msg_start msg;
    bt_msg_start_unpack(&msg, payload);
    if (msg.streams & ~BT_STREAM_FLAGS) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    if (msg.fingers >> BT_MAX_FINGERS != 0) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (msg.streams == 0) {
        bt_session_stop(session);
    }
    session->streams = msg.streams;
    session->fingers = msg.fingers;
    session->keepalive_ms = msg.keepalive_ms;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        session->finger[f].fresh = true;
        session->finger[f].unsent = 0;
        session->finger[f].bands.begun = false;
    }
    return BT_ERROR_OK;
}

static uint8_t subscribe(bt_session *session, const uint8_t *payload)
{
    bt_msg_subscribe msg;
    bt_msg_subscribe_unpack(&msg, payload);
    if (msg.quantities & ~BT_QUANTITY_FLAGS) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    if (msg.fingers >> BT_MAX_FINGERS != 0) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (msg.fingers >> f & 1) {
            session->finger[f].quantities = msg.quantities;
        }
    }
    return BT_ERROR_OK;
}

static uint8_t tare_now(bt_session *session, const uint8_t *payload)
{
    bt_msg_tare_now msg;
    bt_msg_tare_now_unpack(&msg, payload);
    if (msg.finger >= BT_MAX_FINGERS || !session->finger[msg.finger].present) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    return bt_tare_now(&session->finger[msg.finger].tare);
}

static uint8_t tare_set(bt_session *session, const uint8_t *payload)
{
    bt_msg_tare_set msg;
    bt_msg_tare_set_unpack(&msg, payload);
    // Accepted even if the finger has not answered yet: a stored tare may come before the first frame.
    if (msg.finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    bt_baseline base;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (msg.tare_q4[i] > BT_E_MAX_Q4) {
            return BT_ERROR_OUT_OF_RANGE;
        }
        base.electrode_q16[i] = (uint32_t)msg.tare_q4[i] << 12;
    }
    if (msg.pdc_tare_q4 > BT_E_MAX_Q4 && msg.pdc_tare_q4 != BT_INVALID_COUNT) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    base.pdc_q16 = msg.pdc_tare_q4 == BT_INVALID_COUNT ? BT_TARE_UNKNOWN : (uint32_t)msg.pdc_tare_q4 << 12;
    return bt_tare_set(&session->finger[msg.finger].tare, &base);
}

// HOLD and RELEASE.
static uint8_t hold_fingers(bt_session *session, const uint8_t *payload, bool held)
{
    bt_msg_hold msg;
    bt_msg_hold_unpack(&msg, payload);
    if (msg.fingers >> BT_MAX_FINGERS != 0) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (msg.fingers >> f & 1) {
            held ? bt_tare_hold(&session->finger[f].tare) : bt_tare_release(&session->finger[f].tare);
        }
    }
    return BT_ERROR_OK;
}

_Static_assert(BT_HOLD_BYTES == BT_RELEASE_BYTES, "HOLD and RELEASE are read alike");

static void sensor_info(bt_session *session, uint8_t req_id, uint8_t finger)
{
    uint8_t payload[BT_SENSOR_INFO_BYTES];
    bt_sensor_info info = session->info[finger];
    info.req_id = req_id;
    info.finger = finger;
    info.present = info.present && session->finger[finger].silent_rounds < BT_UNPLUGGED_ROUNDS;
    bt_msg_sensor_info_pack(&info, payload);
    bt_session_send(session, BT_SENSOR_INFO_ID, payload);
}

static void point(bt_session *session, uint8_t req_id, uint8_t finger)
{
    uint8_t payload[BT_POINT_BYTES];
    bt_msg_point msg = {.req_id = req_id};
    bt_finger_point(&session->finger[finger], &session->solve[finger], &msg);
    bt_msg_point_pack(&msg, payload);
    bt_session_send(session, BT_POINT_ID, payload);
}

static void setting(bt_session *session, uint8_t req_id, uint8_t id)
{
    uint8_t payload[BT_SETTING_BYTES];
    bt_msg_setting msg = {.req_id = req_id, .setting = id, .value = bt_settings_get(&session->settings, id)};
    bt_msg_setting_pack(&msg, payload);
    bt_session_send(session, BT_SETTING_ID, payload);
}

static uint8_t set_setting(bt_session *session, const uint8_t *payload)
{
    bt_msg_set_setting msg;
    bt_msg_set_setting_unpack(&msg, payload);
    if (session->streams != 0) {
        return BT_ERROR_BUSY; // one recording, one set of settings
    }
    uint8_t error = bt_settings_set(&session->settings, msg.setting, msg.value);
    if (error == BT_ERROR_OK) {
        bt_session_use_settings(session);
        setting(session, msg.req_id, msg.setting);
    }
    return error;
}

static void calibration(bt_session *session, uint8_t req_id, uint8_t finger)
{
    uint8_t payload[BT_CALIBRATION_BYTES];
    const bt_calibration *its = &session->calibration[finger];
    bt_msg_calibration msg = {
        .req_id = req_id,
        .finger = finger,
        .state = session->calibration_state[finger],
        .made_s = its->made_s,
    };
    memcpy(msg.serial, its->serial, sizeof msg.serial);
    for (int k = 0; k < BT_CALIBRATION_VALUES; k++) {
        msg.value[k] =
            its->present ? its->value[k] : bt_settings_get(&session->settings, bt_calibration_setting[k]);
    }
    bt_msg_calibration_pack(&msg, payload);
    bt_session_send(session, BT_CALIBRATION_ID, payload);
}

static uint8_t set_calibration(bt_session *session, const uint8_t *payload)
{
    bt_msg_set_calibration msg;
    bt_msg_set_calibration_unpack(&msg, payload);
    if (msg.finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (session->streams != 0) {
        return BT_ERROR_BUSY;
    }
    bt_settings trial = session->settings;
    bt_calibration its = {.present = true, .unsaved = true, .made_s = msg.made_s};
    memcpy(its.serial, msg.serial, sizeof its.serial);
    memcpy(its.value, msg.value, sizeof its.value);
    if (!bt_serial_fits(its.serial, session->info[msg.finger].serial)) {
        return BT_ERROR_OTHER_SENSOR;
    }
    uint8_t error = bt_calibration_apply(&its, &trial);
    if (error == BT_ERROR_OK) {
        session->calibration[msg.finger] = its;
        bt_session_use_settings(session);
        calibration(session, msg.req_id, msg.finger);
    }
    return error;
}

static uint8_t clear_calibration(bt_session *session, uint8_t finger)
{
    if (finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (session->streams != 0) {
        return BT_ERROR_BUSY;
    }
    session->calibration[finger] = (bt_calibration){.unsaved = true};
    bt_session_use_settings(session);
    return BT_ERROR_OK;
}

static uint8_t save_calibrations(bt_session *session)
{
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        // The others stay as stored, maybe by newer firmware with records that this one cannot read.
        if (session->calibration[f].unsaved) {
            uint8_t error = session->board.save_calibration(f, &session->calibration[f]);
            if (error != BT_ERROR_OK) {
                return error;
            }
            session->calibration[f].unsaved = false;
        }
    }
    return BT_ERROR_OK;
}

static uint8_t save(bt_session *session)
{
    if (session->streams != 0) {
        return BT_ERROR_BUSY; // sampling stops while flash is written
    }
    const bt_board_actions *board = &session->board;
    if (board->save_settings == NULL || board->save_calibration == NULL || board->save_map == NULL) {
        return BT_ERROR_NOT_HERE;
    }
    uint8_t error = board->save_settings(&session->settings);
    if (error == BT_ERROR_OK) {
        error = save_calibrations(session);
    }
    return error == BT_ERROR_OK ? bt_save_maps(session) : error;
}

static uint8_t reboot_bootloader(const bt_session *session, const uint8_t *payload)
{
    bt_msg_reboot_bootloader msg;
    bt_msg_reboot_bootloader_unpack(&msg, payload);
    if (msg.magic != BT_BOOTLOADER_MAGIC) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    return session->board.reboot_bootloader == NULL ? BT_ERROR_NOT_HERE : session->board.reboot_bootloader();
}

void bt_command(bt_session *session, uint8_t id, const uint8_t *payload, uint32_t now_us)
{
    if (id < 0x80) {
        return; // one of our own messages, echoed by a terminal driver
    }
    session->heard_us = now_us;
    if (payload == NULL) { // of a payload of another length nothing can be trusted, not even where req_id is
        reply(session, 0, id, bt_wire_payload_bytes(id) < 0 ? BT_ERROR_UNKNOWN_COMMAND : BT_ERROR_BAD_LENGTH);
        return;
    }
    uint8_t req_id = payload[0];
    uint8_t error = BT_ERROR_OK;
    bool answered;
    switch (id) {
    case BT_HELLO_REQUEST_ID:
        hello(session, payload);
        return;
    case BT_START_ID:
        error = start(session, payload);
        break;
    case BT_STOP_ID:
        bt_session_stop(session);
        break;
    case BT_PING_ID:
        break;
    case BT_SUBSCRIBE_ID:
        error = subscribe(session, payload);
        break;
    case BT_TARE_NOW_ID:
        error = tare_now(session, payload);
        break;
    case BT_TARE_SET_ID:
        error = tare_set(session, payload);
        break;
    case BT_HOLD_ID:
        error = hold_fingers(session, payload, true);
        break;
    case BT_RELEASE_ID:
        error = hold_fingers(session, payload, false);
        break;
    case BT_CLEAR_FAULTS_ID:
        bt_faults_clear(session, payload);
        break;
    case BT_GET_STATUS_ID:
        bt_session_send_status(session, req_id, now_us);
        return;
    case BT_GET_SENSOR_STATUS_ID:
        if (payload[1] < BT_MAX_FINGERS) {
            bt_session_send_sensor_status(session, req_id, payload[1], now_us);
            return;
        }
        error = BT_ERROR_NO_SUCH_FINGER;
        break;
    case BT_GET_SENSOR_INFO_ID:
        if (payload[1] < BT_MAX_FINGERS) {
            sensor_info(session, req_id, payload[1]);
            return;
        }
        error = BT_ERROR_NO_SUCH_FINGER;
        break;
    case BT_GET_POINT_ID:
        if (payload[1] < BT_MAX_FINGERS && bt_sensors_refused(session, payload[1])) {
            error = BT_ERROR_OTHER_SENSOR;
            break;
        }
        if (payload[1] < BT_MAX_FINGERS && session->finger[payload[1]].present) {
            point(session, req_id, payload[1]);
            return;
        }
        error = BT_ERROR_NO_SUCH_FINGER;
        break;
    case BT_GET_SETTING_ID:
        if (bt_settings_has(payload[1])) {
            setting(session, req_id, payload[1]);
            return;
        }
        error = BT_ERROR_UNKNOWN_SETTING;
        break;
    case BT_SET_SETTING_ID:
        error = set_setting(session, payload);
        if (error == BT_ERROR_OK) {
            return;
        }
        break;
    case BT_GET_CALIBRATION_ID:
        if (payload[1] < BT_MAX_FINGERS) {
            calibration(session, req_id, payload[1]);
            return;
        }
        error = BT_ERROR_NO_SUCH_FINGER;
        break;
    case BT_SET_CALIBRATION_ID:
        error = set_calibration(session, payload);
        if (error == BT_ERROR_OK) {
            return;
        }
        break;
    case BT_CLEAR_CALIBRATION_ID:
        error = clear_calibration(session, payload[1]);
        break;
    case BT_REBOOT_BOOTLOADER_ID:
        error = reboot_bootloader(session, payload);
        break;
    case BT_SAVE_SETTINGS_ID:
        error = save(session);
        break;
    default:
        error = bt_map_command(session, id, payload, &answered);
        if (answered) {
            return;
        }
        break;
    }
    reply(session, req_id, id, error);
}
