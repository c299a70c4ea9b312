#include "talk/map_commands.h"

#include <string.h>

uint8_t bt_map_get(bt_session *session, const uint8_t *payload)
{
    const uint8_t f = payload[BT_COMMAND_FINGER_AT];
    const bt_finger_map *map = &session->map[f];
    bt_msg_map_info msg = {
        .req_id = payload[BT_COMMAND_REQ_ID_AT], .finger = f, .state = session->map_state[f]};
    if (map->place.bytes != 0) {
        memcpy(msg.serial, map->map.serial, sizeof msg.serial);
        msg.made_s = map->map.made_s;
        msg.size_bytes = map->place.bytes;
        msg.crc32 = map->place.crc32;
    }
    bt_msg_map_info_send(session, &msg);
    return BT_ERROR_OK;
}

uint8_t bt_map_read(bt_session *session, const uint8_t *payload)
{
    bt_msg_read_map asked;
    bt_msg_read_map_unpack(&asked, payload);
    const bt_map_place *place = &session->map[asked.finger].place;
    if (asked.offset >= place->bytes) { // also if there is no map
        return BT_ERROR_OUT_OF_RANGE;
    }
    bt_msg_map_data msg = {.req_id = asked.req_id, .finger = asked.finger, .offset = asked.offset};
    size_t left = (size_t)(place->bytes - asked.offset);
    memset(msg.data, 0xFF, sizeof msg.data);
    memcpy(msg.data, bt_map_bytes(session->board.maps, place) + asked.offset,
           left < sizeof msg.data ? left : sizeof msg.data);
    bt_msg_map_data_send(session, &msg);
    return BT_ERROR_OK;
}

uint8_t bt_map_begin(bt_session *session, const uint8_t *payload)
{
    bt_msg_begin_map msg;
    bt_msg_begin_map_unpack(&msg, payload);
    if (msg.size_bytes == 0 || msg.size_bytes > session->board.maps->max_bytes) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    // An earlier upload ends. The slot after that one is used, so that a slot that failed is passed over.
    session->upload = (bt_upload){
        .open = true,
        .finger = msg.finger,
        .place.slot = bt_map_free_slot(session->board.maps, session->map, session->upload.place.slot),
        .place.bytes = msg.size_bytes,
        .place.crc32 = msg.crc32,
    };
    return BT_ERROR_OK;
}

uint8_t bt_map_write(bt_session *session, const uint8_t *payload)
{
    bt_msg_write_map msg;
    bt_msg_write_map_unpack(&msg, payload);
    if (!session->upload.open || session->upload.finger != msg.finger) {
        return BT_ERROR_NOT_BEGUN;
    }
    return bt_upload_write(&session->upload, session->board.maps, msg.offset, msg.data);
}

uint8_t bt_map_end(bt_session *session, const uint8_t *payload)
{
    bt_msg_end_map msg;
    bt_msg_end_map_unpack(&msg, payload);
    bt_upload *upload = &session->upload;
    bt_finger_map *map = &session->map[msg.finger];
    if (!upload->open || upload->finger != msg.finger || upload->place.crc32 != msg.crc32) {
        // Either the reply to an earlier END_MAP was lost, or there was no BEGIN_MAP.
        bool has_it = map->place.bytes != 0 && map->place.crc32 == msg.crc32;
        return has_it ? bt_map_get(session, payload) : BT_ERROR_NOT_BEGUN;
    }
    if (!bt_upload_whole(upload)) {
        return BT_ERROR_NOT_WHOLE;
    }
    uint8_t error = bt_finger_map_use(map, session->board.maps, msg.finger, &upload->place,
                                      session->info[msg.finger].serial);
    if (error != BT_ERROR_OK) {
        return error;
    }
    map->unsaved = true;
    upload->open = false;
    bt_session_use_settings(session);
    return bt_map_get(session, payload);
}

uint8_t bt_map_clear(bt_session *session, const uint8_t *payload)
{
    bt_finger_map *map = &session->map[payload[BT_COMMAND_FINGER_AT]];
    map->place.bytes = 0;
    bt_map_close(&map->map);
    map->unsaved = true;
    bt_session_use_settings(session);
    return BT_ERROR_OK;
}
