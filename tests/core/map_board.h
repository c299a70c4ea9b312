// A board with a small flash for wrench maps, and a host that sends and asks for them.
#ifndef BIOTAC_TEST_MAP_BOARD_H
#define BIOTAC_TEST_MAP_BOARD_H

#include "fake_board.h"
#include "fake_host.h"
#include "map_blob.h"

#define PART ((uint16_t)BT_MAP_PART_BYTES)

static bool stored_maps_are_good;

static inline void power_on(void)
{
    new_session();
    session.board = keeps;
    plug(2, SENSOR);
    bt_session_load(&session);
    stored_maps_are_good = !(session.status.faults & BT_FAULT_FLAG_STORAGE);
}

BEFORE_EACH(new_board)
{
    memset(kept, 0xFF, BT_STORAGE_BYTES);
    memset(SLOTS, 0, BT_MAPS_BYTES); // whatever was there before
    erases = programs = 0;
    worn = false;
    refused_record = 0;
    power_on();
}

// ---- commands ---------------------------------------------------------------------------------------------

static inline uint8_t begin(uint8_t finger, uint16_t bytes, uint32_t crc32)
{
    uint8_t payload[BT_BEGIN_MAP_BYTES];
    bt_msg_begin_map msg = {.req_id = 1, .finger = finger, .size_bytes = bytes, .crc32 = crc32};
    bt_msg_begin_map_pack(&msg, payload);
    return host_error(&session, BT_BEGIN_MAP_ID, payload, sizeof payload);
}

static inline uint8_t write_bytes(uint8_t finger, uint16_t offset, const uint8_t *data, size_t bytes)
{
    uint8_t payload[BT_WRITE_MAP_BYTES];
    bt_msg_write_map msg = {.req_id = 2, .finger = finger, .offset = offset};
    memset(msg.data, 0x5A, sizeof msg.data); // not as erased flash: the board must not care
    memcpy(msg.data, data, bytes < PART ? bytes : PART);
    bt_msg_write_map_pack(&msg, payload);
    int erases_before = erases, programs_before = programs;
    uint8_t error = host_error(&session, BT_WRITE_MAP_ID, payload, sizeof payload);
    assert_true(erases - erases_before <= 1 && programs - programs_before <= 1); // nothing blocks for longer
    return error;
}

static inline uint8_t write_part(uint8_t finger, const uint8_t *blob, size_t bytes, size_t part)
{
    size_t at = part * PART;
    return write_bytes(finger, (uint16_t)at, blob + at, bytes - at);
}

static inline uint8_t end(uint8_t finger, uint32_t crc32)
{
    uint8_t payload[BT_END_MAP_BYTES];
    bt_msg_end_map msg = {.req_id = 3, .finger = finger, .crc32 = crc32};
    bt_msg_end_map_pack(&msg, payload);
    const received_message *message = host_ask(&session, BT_END_MAP_ID, payload, sizeof payload);
    assert_int_equal(message->payload[0], 3);
    if (message->id == BT_MAP_INFO_ID) {
        return BT_ERROR_OK;
    }
    assert_int_equal(message->id, BT_REPLY_ID);
    return message->payload[2];
}

static inline uint8_t clear(uint8_t finger)
{
    uint8_t payload[2] = {4, finger};
    return host_error(&session, BT_CLEAR_MAP_ID, payload, 2);
}

static inline uint8_t save(void)
{
    return host_error(&session, BT_SAVE_SETTINGS_ID, "\5", 1);
}

static inline bt_msg_map_info info(uint8_t finger)
{
    uint8_t payload[2] = {6, finger};
    bt_msg_map_info msg;
    const received_message *message = host_ask(&session, BT_GET_MAP_ID, payload, 2);
    assert_int_equal(message->id, BT_MAP_INFO_ID);
    bt_msg_map_info_unpack(&msg, message->payload);
    assert_true(msg.req_id == 6 && msg.finger == finger);
    return msg;
}

static inline size_t parts_of(size_t bytes)
{
    return (bytes + PART - 1) / PART;
}

static inline void write_all(uint8_t finger, const uint8_t *blob, size_t bytes)
{
    assert_int_equal(begin(finger, (uint16_t)bytes, bt_crc32(blob, bytes)), BT_ERROR_OK);
    for (size_t part = 0; part < parts_of(bytes); part++) {
        assert_int_equal(write_part(finger, blob, bytes, part), BT_ERROR_OK);
    }
}

static inline uint8_t upload(uint8_t finger, const uint8_t *blob, size_t bytes)
{
    write_all(finger, blob, bytes);
    return end(finger, bt_crc32(blob, bytes));
}

// The finger has this map, by the board's word and by every byte; NULL: none.
static inline void assert_has(uint8_t finger, const uint8_t *blob, size_t bytes, uint8_t state)
{
    bt_msg_map_info found = info(finger);
    assert_int_equal(found.state, state);
    assert_int_equal(found.size_bytes, bytes);
    for (uint16_t at = 0; at < bytes; at = (uint16_t)(at + PART)) {
        uint8_t payload[BT_READ_MAP_BYTES];
        bt_msg_read_map ask = {.req_id = 7, .finger = finger, .offset = at};
        bt_msg_map_data msg;
        bt_msg_read_map_pack(&ask, payload);
        const received_message *message = host_ask(&session, BT_READ_MAP_ID, payload, sizeof payload);
        assert_int_equal(message->id, BT_MAP_DATA_ID);
        bt_msg_map_data_unpack(&msg, message->payload);
        assert_true(msg.req_id == 7 && msg.finger == finger && msg.offset == at);
        for (size_t k = 0; k < PART; k++) {
            assert_int_equal(msg.data[k], at + k < bytes ? blob[at + k] : 0xFF);
        }
    }
    if (blob != NULL) {
        assert_int_equal(found.crc32, bt_crc32(blob, bytes));
        assert_int_equal(found.made_s, bt_get_u32(blob + 20));
        assert_memory_equal(found.serial, blob + 4, sizeof found.serial);
    }
}

static uint8_t blob[BT_MAP_MAX_BYTES], other[BT_MAP_MAX_BYTES];

#endif
