#include "talk/commands.h"

#include "talk/map_commands.h"
#include "talk/saved.h"
#include "talk/sensors.h"
#include "talk/status.h"

#include <string.h>

// Each command gets a checked payload of the right length, which begins with req_id, and returns an enum
// bt_error. A REPLY with the error follows, BT_ERROR_OK included, unless the table below marks the command as
// ANSWERS.

static void reply(bt_session *session, uint8_t req_id, uint8_t command, uint8_t error)
{
    bt_msg_reply msg = {.req_id = req_id, .command = command, .error = error};
    bt_msg_reply_send(session, &msg);
}

static void subscribe_as_at_first(bt_session *session)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        session->finger[f].quantities = BT_SUBSCRIBED_AT_FIRST;
    }
}

// Drop everything that the other host asked for, except holds.
static void change_owner(bt_session *session)
{
    const uint8_t before = session->owner, after = session->link;
    const bool was_in_use = bt_session_is_owned(session) || session->status.streams != 0;
    bt_session_stop(session);
    subscribe_as_at_first(session);
    session->owner = after;
    session->owner_rx_us = session->command_us;
    if (was_in_use) {
        session->status.faults |= BT_FAULT_FLAG_LINK_TAKEN;
        session->link = before;
        bt_session_send_status(session, 0, session->command_us);
        session->link = after;
        bt_session_send_status(session, 0, session->command_us);
    }
}

static uint8_t take_link(bt_session *session, const uint8_t *payload)
{
    bt_msg_take_link msg;
    bt_msg_take_link_unpack(&msg, payload);
    if (msg.keepalive_ms == 0) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    if (session->owner != session->link) {
        change_owner(session);
    }
    session->keepalive_ms = msg.keepalive_ms;
    return BT_ERROR_OK;
}

static uint8_t hello_request(bt_session *session, const uint8_t *payload)
{
    if (session->owner == session->link && session->status.streams == 0) {
        subscribe_as_at_first(session); // drop the choice of an earlier program on this port
    }
    bt_msg_hello_request request;
    bt_msg_hello_request_unpack(&request, payload);
    bt_msg_hello msg = session->hello;
    msg.req_id = request.req_id;
    msg.nonce = request.nonce;
    msg.map_bytes = session->board.maps != NULL ? session->board.maps->max_bytes : 0;
    msg.fingers_present = bt_session_present(session);
    bt_msg_hello_send(session, &msg);
    return BT_ERROR_OK;
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
        return BT_ERROR_OK;
    }
    bt_session_end_trial(session);
    session->status.streams = msg.streams;
    session->fingers = msg.fingers;
    session->keepalive_ms = msg.keepalive_ms;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        session->finger[f].fresh = true;
        session->finger[f].unsent = 0;
    }
    return BT_ERROR_OK;
}

// STOP ends only the sender's own stream; every program sends it first.
static uint8_t stop(bt_session *session, const uint8_t *payload)
{
    (void)payload;
    if (session->owner == session->link) {
        bt_session_stop(session);
    }
    return BT_ERROR_OK;
}

static uint8_t ping(bt_session *session, const uint8_t *payload)
{
    (void)session;
    (void)payload;
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
    bt_finger *finger = &session->finger[payload[BT_COMMAND_FINGER_AT]];
    return finger->present ? bt_tare_now(&finger->tare) : BT_ERROR_NO_SUCH_FINGER;
}

// Accepted before the finger has answered: a stored tare may precede the first frame.
static uint8_t tare_set(bt_session *session, const uint8_t *payload)
{
    bt_msg_tare_set msg;
    bt_msg_tare_set_unpack(&msg, payload);
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
    return bt_tare_set(&session->finger[msg.finger].tare, &base, msg.age_ms);
}

static uint8_t set_held(bt_session *session, uint8_t fingers, bool held)
{
    if (fingers >> BT_MAX_FINGERS != 0) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (fingers >> f & 1) {
            held ? bt_tare_hold(&session->finger[f].tare) : bt_tare_release(&session->finger[f].tare);
        }
    }
    return BT_ERROR_OK;
}

static uint8_t hold(bt_session *session, const uint8_t *payload)
{
    bt_msg_hold msg;
    bt_msg_hold_unpack(&msg, payload);
    return set_held(session, msg.fingers, true);
}

static uint8_t release(bt_session *session, const uint8_t *payload)
{
    bt_msg_release msg;
    bt_msg_release_unpack(&msg, payload);
    return set_held(session, msg.fingers, false);
}

static uint8_t clear_faults(bt_session *session, const uint8_t *payload)
{
    bt_msg_clear_faults seen;
    bt_msg_clear_faults_unpack(&seen, payload);
    session->status.faults &= (uint16_t)~seen.faults;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        session->status.finger_faults[f] &= ~seen.finger_faults[f];
    }
    return BT_ERROR_OK;
}

static uint8_t get_status(bt_session *session, const uint8_t *payload)
{
    bt_session_send_status(session, payload[BT_COMMAND_REQ_ID_AT], session->command_us);
    return BT_ERROR_OK;
}

static uint8_t get_sensor_status(bt_session *session, const uint8_t *payload)
{
    bt_session_send_sensor_status(session, payload[BT_COMMAND_REQ_ID_AT], payload[BT_COMMAND_FINGER_AT],
                                  session->command_us);
    return BT_ERROR_OK;
}

static uint8_t get_sensor_info(bt_session *session, const uint8_t *payload)
{
    const uint8_t f = payload[BT_COMMAND_FINGER_AT];
    bt_sensor_info info = session->info[f];
    info.req_id = payload[BT_COMMAND_REQ_ID_AT];
    info.finger = f;
    info.present = info.present && session->finger[f].silent_rounds < BT_UNPLUGGED_ROUNDS;
    bt_msg_sensor_info_send(session, &info);
    return BT_ERROR_OK;
}

static uint8_t get_point(bt_session *session, const uint8_t *payload)
{
    const uint8_t f = payload[BT_COMMAND_FINGER_AT];
    bt_msg_point msg = {.req_id = payload[BT_COMMAND_REQ_ID_AT]};
    if (session->refused >> f & 1) {
        return BT_ERROR_OTHER_SENSOR;
    }
    if (!session->finger[f].present) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    bt_finger_point(&session->finger[f], &session->solve[f], &msg);
    bt_msg_point_send(session, &msg);
    return BT_ERROR_OK;
}

static void send_setting(bt_session *session, uint8_t req_id, uint8_t id)
{
    bt_msg_setting msg = {.req_id = req_id, .setting = id, .value = bt_settings_get(&session->settings, id)};
    bt_msg_setting_send(session, &msg);
}

static uint8_t get_setting(bt_session *session, const uint8_t *payload)
{
    bt_msg_get_setting msg;
    bt_msg_get_setting_unpack(&msg, payload);
    if (!bt_settings_has(msg.setting)) {
        return BT_ERROR_UNKNOWN_SETTING;
    }
    send_setting(session, msg.req_id, msg.setting);
    return BT_ERROR_OK;
}

static uint8_t set_setting(bt_session *session, const uint8_t *payload)
{
    bt_msg_set_setting msg;
    bt_msg_set_setting_unpack(&msg, payload);
    uint8_t error = bt_settings_set(&session->settings, msg.setting, msg.value);
    if (error == BT_ERROR_OK) {
        bt_session_use_settings(session);
        send_setting(session, msg.req_id, msg.setting);
    }
    return error;
}

static uint8_t get_calibration(bt_session *session, const uint8_t *payload)
{
    const uint8_t f = payload[BT_COMMAND_FINGER_AT];
    const bt_calibration *calibration = &session->calibration[f];
    bt_msg_calibration msg = {
        .req_id = payload[BT_COMMAND_REQ_ID_AT],
        .finger = f,
        .state = session->calibration_state[f],
        .made_s = calibration->made_s,
    };
    memcpy(msg.serial, calibration->serial, sizeof msg.serial);
    for (int k = 0; k < BT_CALIBRATION_VALUES; k++) {
        msg.value[k] = calibration->present ? calibration->value[k]
                                            : bt_settings_get(&session->settings, bt_calibration_setting[k]);
    }
    bt_msg_calibration_send(session, &msg);
    return BT_ERROR_OK;
}

static uint8_t set_calibration(bt_session *session, const uint8_t *payload)
{
    bt_msg_set_calibration msg;
    bt_msg_set_calibration_unpack(&msg, payload);
    bt_settings trial = session->settings;
    bt_calibration calibration = {.present = true, .unsaved = true, .made_s = msg.made_s};
    memcpy(calibration.serial, msg.serial, sizeof calibration.serial);
    memcpy(calibration.value, msg.value, sizeof calibration.value);
    if (!bt_serial_fits(calibration.serial, session->info[msg.finger].serial)) {
        return BT_ERROR_OTHER_SENSOR;
    }
    uint8_t error = bt_calibration_apply(&calibration, &trial);
    if (error != BT_ERROR_OK) {
        return error;
    }
    session->calibration[msg.finger] = calibration;
    bt_session_use_settings(session);
    return get_calibration(session, payload);
}

static uint8_t clear_calibration(bt_session *session, const uint8_t *payload)
{
    session->calibration[payload[BT_COMMAND_FINGER_AT]] = (bt_calibration){.unsaved = true};
    bt_session_use_settings(session);
    return BT_ERROR_OK;
}

static uint8_t save(bt_session *session, const uint8_t *payload)
{
    (void)payload;
    return bt_session_save(session);
}

static uint8_t reboot(bt_session *session, const uint8_t *payload)
{
    bt_msg_reboot_bootloader msg;
    bt_msg_reboot_bootloader_unpack(&msg, payload);
    if (msg.magic != BT_BOOTLOADER_MAGIC && msg.magic != BT_RESTART_MAGIC) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    return session->board.reboot == NULL
               ? BT_ERROR_NOT_HERE
               : session->board.reboot(session->context, msg.magic == BT_BOOTLOADER_MAGIC);
}

static uint8_t get_board_facts(bt_session *session, const uint8_t *payload)
{
    bt_msg_board_facts msg = {.req_id = payload[BT_COMMAND_REQ_ID_AT]};
    if (session->board.measure == NULL) {
        return BT_ERROR_NOT_HERE;
    }
    session->board.measure(session->context, &msg);
    bt_msg_board_facts_send(session, &msg);
    return BT_ERROR_OK;
}

static uint8_t set_bus_rate(bt_session *session, const uint8_t *payload)
{
    bt_msg_set_bus_rate msg;
    bt_msg_set_bus_rate_unpack(&msg, payload);
    if (session->board.set_bus_rate == NULL) {
        return BT_ERROR_NOT_HERE;
    }
    session->bus_rate_overridden = true;
    session->board.set_bus_rate(session->context, msg.bus_khz);
    return get_board_facts(session, payload);
}

enum check {
    ANSWERS = 1, // sends the answer itself where it returns BT_ERROR_OK
    FINGER = 2,  // the byte at BT_COMMAND_FINGER_AT must be a finger
    STOPPED = 4, // not while streaming: one recording, one set of values; and flash stops the sampling
    MAPS = 8,    // the board must have a place for maps
    READS = 16,  // changes nothing for another host: allowed to a host that is not the owner
};

static const struct {
    uint8_t id;
    uint8_t checks; // in the order of enum check
    uint8_t (*run)(bt_session *session, const uint8_t *payload);
} commands[] = {
    {BT_HELLO_REQUEST_ID, READS | ANSWERS, hello_request},
    {BT_TAKE_LINK_ID, READS, take_link},
    {BT_START_ID, 0, start},
    {BT_STOP_ID, READS, stop},
    {BT_PING_ID, READS, ping},
    {BT_SUBSCRIBE_ID, 0, subscribe},
    {BT_TARE_NOW_ID, FINGER, tare_now},
    {BT_TARE_SET_ID, FINGER, tare_set},
    {BT_HOLD_ID, 0, hold},
    {BT_RELEASE_ID, 0, release},
    {BT_CLEAR_FAULTS_ID, 0, clear_faults},
    {BT_GET_STATUS_ID, READS | ANSWERS, get_status},
    {BT_GET_SENSOR_STATUS_ID, READS | ANSWERS | FINGER, get_sensor_status},
    {BT_GET_SENSOR_INFO_ID, READS | ANSWERS | FINGER, get_sensor_info},
    {BT_GET_POINT_ID, READS | ANSWERS | FINGER, get_point},
    {BT_GET_SETTING_ID, READS | ANSWERS, get_setting},
    {BT_SET_SETTING_ID, ANSWERS | STOPPED, set_setting},
    {BT_GET_CALIBRATION_ID, READS | ANSWERS | FINGER, get_calibration},
    {BT_SET_CALIBRATION_ID, ANSWERS | FINGER | STOPPED, set_calibration},
    {BT_CLEAR_CALIBRATION_ID, FINGER | STOPPED, clear_calibration},
    {BT_GET_MAP_ID, READS | ANSWERS | FINGER, bt_map_get},
    {BT_READ_MAP_ID, READS | ANSWERS | FINGER, bt_map_read},
    {BT_BEGIN_MAP_ID, FINGER | STOPPED | MAPS, bt_map_begin},
    {BT_WRITE_MAP_ID, FINGER | STOPPED | MAPS, bt_map_write},
    {BT_END_MAP_ID, ANSWERS | FINGER | STOPPED | MAPS, bt_map_end},
    {BT_CLEAR_MAP_ID, FINGER | STOPPED | MAPS, bt_map_clear},
    {BT_SAVE_SETTINGS_ID, STOPPED, save},
    {BT_REBOOT_BOOTLOADER_ID, 0, reboot},
    {BT_GET_BOARD_FACTS_ID, READS | ANSWERS, get_board_facts},
    {BT_SET_BUS_RATE_ID, ANSWERS | STOPPED, set_bus_rate},
};

static uint8_t check(const bt_session *session, uint8_t checks, const uint8_t *payload)
{
    if (!(checks & READS) && session->owner != session->link && bt_session_is_owned(session)) {
        return BT_ERROR_LINK_BUSY;
    }
    // Commands that store something need a finger that the board can have. Questions about other fingers are
    // answered as for an absent sensor.
    uint8_t fingers = checks & STOPPED ? session->hello.fingers : BT_MAX_FINGERS;
    if (checks & FINGER && payload[BT_COMMAND_FINGER_AT] >= fingers) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (checks & STOPPED && session->status.streams != 0) {
        return BT_ERROR_BUSY;
    }
    return checks & MAPS && session->board.maps == NULL ? BT_ERROR_NOT_HERE : BT_ERROR_OK;
}

void bt_command(bt_session *session, uint8_t id, const uint8_t *payload, uint32_t now_us)
{
    if (id < 0x80) {
        return; // one of our own messages, echoed by a terminal driver
    }
    session->command_us = now_us;
    if (session->owner == session->link || session->owner == BT_NO_LINK) {
        session->owner_rx_us = now_us;
    }
    if (payload == NULL) { // with a wrong length nothing can be trusted, not even where req_id is
        reply(session, 0, id, bt_wire_payload_bytes(id) < 0 ? BT_ERROR_UNKNOWN_COMMAND : BT_ERROR_BAD_LENGTH);
        return;
    }
    uint8_t error = BT_ERROR_UNKNOWN_COMMAND;
    for (size_t k = 0; k < sizeof commands / sizeof *commands; k++) {
        if (commands[k].id != id) {
            continue;
        }
        error = check(session, commands[k].checks, payload);
        if (error == BT_ERROR_OK && !(commands[k].checks & READS) && session->owner != session->link) {
            change_owner(session);
        }
        error = error == BT_ERROR_OK ? commands[k].run(session, payload) : error;
        if (error == BT_ERROR_OK && commands[k].checks & ANSWERS) {
            return;
        }
    }
    reply(session, payload[BT_COMMAND_REQ_ID_AT], id, error);
}
