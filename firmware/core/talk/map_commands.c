#include "talk/map_commands.h"

#include <string.h>

_Static_assert(BT_SERIAL_BYTES == BT_MAP_SERIAL_BYTES, "a map's serial number is a sensor's");

static void send_info(bt_session *session, uint8_t req_id, uint8_t finger)
{
    uint8_t payload[BT_MAP_INFO_BYTES];
    const bt_finger_map *its = &session->map[finger];
    bt_msg_map_info msg = {.req_id = req_id, .finger = finger, .state = session->map_state[finger]};
    if (its->place.bytes != 0) {
        memcpy(msg.serial, its->map.serial, sizeof msg.serial);
        msg.made_s = its->map.made_s;
        msg.size_bytes = its->place.bytes;
        msg.crc32 = its->place.crc32;
    }
    bt_msg_map_info_pack(&msg, payload);
    bt_session_send(session, BT_MAP_INFO_ID, payload);
}

static uint8_t read_map(bt_session *session, const uint8_t *payload)
{
    uint8_t out[BT_MAP_DATA_BYTES];
    bt_msg_read_map asked;
    bt_msg_read_map_unpack(&asked, payload);
    if (asked.finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    const bt_map_place *place = &session->map[asked.finger].place;
    if (asked.offset >= place->bytes) { // also if there is no map
        return BT_ERROR_OUT_OF_RANGE;
    }
    bt_msg_map_data msg = {.req_id = asked.req_id, .finger = asked.finger, .offset = asked.offset};
    size_t left = (size_t)(place->bytes - asked.offset);
    memset(msg.data, 0xFF, sizeof msg.data);
    memcpy(msg.data, bt_map_bytes(session->board.maps, place) + asked.offset,
           left < sizeof msg.data ? left : sizeof msg.data);
    bt_msg_map_data_pack(&msg, out);
    bt_session_send(session, BT_MAP_DATA_ID, out);
    return BT_ERROR_OK;
}

// Checks for every command that changes a map.
static uint8_t may_change(const bt_session *session, uint8_t finger)
{
    if (finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (session->streams != 0) {
        return BT_ERROR_BUSY; // one recording, one map; and sampling stops while flash is written
    }
    return session->board.maps == NULL ? BT_ERROR_NOT_HERE : BT_ERROR_OK;
}

static uint8_t begin_map(bt_session *session, const uint8_t *payload)
{
    bt_msg_begin_map msg;
    bt_msg_begin_map_unpack(&msg, payload);
    uint8_t error = may_change(session, msg.finger);
    if (error != BT_ERROR_OK) {
        return error;
    }
    if (msg.size_bytes == 0 || msg.size_bytes > BT_MAP_MAX_BYTES) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    bt_map_place place = {
        .slot = bt_map_free_slot(session->map, session->upload.place.slot),
        .bytes = msg.size_bytes,
        .crc32 = msg.crc32,
    };
    bt_upload_begin(&session->upload, msg.finger, &place);
    return BT_ERROR_OK;
}

static uint8_t write_map(bt_session *session, const uint8_t *payload)
{
    bt_msg_write_map msg;
    bt_msg_write_map_unpack(&msg, payload);
    uint8_t error = may_change(session, msg.finger);
    if (error != BT_ERROR_OK) {
        return error;
    }
    if (!session->upload.open || session->upload.finger != msg.finger) {
        return BT_ERROR_NOT_BEGUN;
    }
    return bt_upload_write(&session->upload, session->board.maps, msg.offset, msg.data);
}

static uint8_t end_map(bt_session *session, const uint8_t *payload)
{
    bt_msg_end_map msg;
    bt_msg_end_map_unpack(&msg, payload);
    uint8_t error = may_change(session, msg.finger);
    if (error != BT_ERROR_OK) {
        return error;
    }
    bt_upload *upload = &session->upload;
    bt_finger_map *its = &session->map[msg.finger];
    if (!upload->open || upload->finger != msg.finger || upload->place.crc32 != msg.crc32) {
        // Either the reply to an earlier END_MAP was lost, or there was no BEGIN_MAP.
        bool has_it = its->place.bytes != 0 && its->place.crc32 == msg.crc32;
        return has_it ? BT_ERROR_OK : BT_ERROR_NOT_BEGUN;
    }
    if (!bt_upload_whole(upload)) {
        return BT_ERROR_NOT_WHOLE;
    }
    error = bt_finger_map_use(its, session->board.maps, msg.finger, &upload->place,
                              session->info[msg.finger].serial);
    if (error != BT_ERROR_OK) {
        return error;
    }
    its->unsaved = true;
    upload->open = false;
    bt_session_use_settings(session);
    return BT_ERROR_OK;
}

static uint8_t clear_map(bt_session *session, uint8_t finger)
{
    uint8_t error = may_change(session, finger);
    if (error == BT_ERROR_OK) {
        session->map[finger].place.bytes = 0;
        bt_map_close(&session->map[finger].map);
        session->map[finger].unsaved = true;
        bt_session_use_settings(session);
    }
    return error;
}

uint8_t bt_map_command(bt_session *session, uint8_t id, const uint8_t *payload, bool *answered)
{
    uint8_t error = BT_ERROR_UNKNOWN_COMMAND;
    *answered = false;
    switch (id) {
    case BT_GET_MAP_ID:
        error = payload[1] < BT_MAX_FINGERS ? BT_ERROR_OK : BT_ERROR_NO_SUCH_FINGER;
        break;
    case BT_READ_MAP_ID:
        error = read_map(session, payload);
        *answered = error == BT_ERROR_OK;
        return error;
    case BT_BEGIN_MAP_ID:
        return begin_map(session, payload);
    case BT_WRITE_MAP_ID:
        return write_map(session, payload);
    case BT_CLEAR_MAP_ID:
        return clear_map(session, payload[1]);
    case BT_END_MAP_ID:
        error = end_map(session, payload);
        break;
    default:
        return error;
    }
    if (error == BT_ERROR_OK) {
        send_info(session, payload[0], payload[1]);
        *answered = true;
    }
    return error;
}

uint8_t bt_save_maps(bt_session *session)
{
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        bt_finger_map *its = &session->map[f];
        // The others stay as stored, maybe by newer firmware with records that this one cannot read.
        if (its->unsaved) {
            uint8_t error = session->board.save_map(f, &its->place);
            if (error != BT_ERROR_OK) {
                return error;
            }
            its->unsaved = false;
            its->stored_slot = its->place.bytes != 0 ? its->place.slot : BT_MAP_SLOTS;
        }
    }
    return BT_ERROR_OK;
}
