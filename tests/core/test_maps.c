// Wrench maps on their way to a finger, through the session: in any order, with repetitions, interrupted, in
// the wrong moment, damaged, of another sensor; and what of all that is kept, over the slots of a small
// flash.
#include "fake_host.h"
#include "map_blob.h"

#define SENSOR "BTEMU00000000042"
#define PART   ((uint16_t)BT_MAP_PART_BYTES)

// ---- flash: the slots, and one record a finger ---------------------------------------------------------

static _Alignas(4) uint8_t slots[BT_MAPS_BYTES];
static int erases;
static int programs;
static bool worn; // programs nothing
static bt_map_place record[BT_MAX_FINGERS];
static uint8_t refused_finger; // whose record is not kept

static bool erase(uint32_t offset)
{
    assert_true(offset % BT_FLASH_SECTOR_BYTES == 0 && offset < BT_MAPS_BYTES);
    memset(slots + offset, 0xFF, BT_FLASH_SECTOR_BYTES);
    erases++;
    return true;
}

static bool program(uint32_t offset, const uint8_t *page)
{
    assert_true(offset % BT_FLASH_PAGE_BYTES == 0 && offset < BT_MAPS_BYTES);
    programs++;
    for (int k = 0; k < BT_FLASH_PAGE_BYTES && !worn; k++) {
        slots[offset + (uint32_t)k] &= page[k];
    }
    return true;
}

static const bt_map_flash map_flash = {erase, program, slots};

static uint8_t save_settings(const bt_settings *settings)
{
    (void)settings;
    return BT_ERROR_OK;
}

static uint8_t save_calibration(uint8_t finger, const bt_calibration *calibration)
{
    (void)finger;
    (void)calibration;
    return BT_ERROR_OK;
}

static uint8_t save_map(uint8_t finger, const bt_map_place *place)
{
    if (finger == refused_finger) {
        return BT_ERROR_NOT_STORED;
    }
    record[finger] = *place;
    return BT_ERROR_OK;
}

static const bt_board_actions actions = {.save_settings = save_settings,
                                         .save_calibration = save_calibration,
                                         .save_map = save_map,
                                         .maps = &map_flash};

static void plug(uint8_t finger, const char *serial)
{
    bt_sensor_info *info = &session.info[finger];
    memset(info, 0, sizeof *info);
    info->present = serial[0] != 0;
    memcpy(info->serial, serial, strlen(serial));
}

static void power_on(void)
{
    (void)new_session(NULL);
    bt_session_use_board(&session, &actions);
    plug(2, SENSOR);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        uint8_t bytes[BT_MAP_RECORD_BYTES];
        size_t n = bt_map_place_pack(&record[f], bytes);
        bt_finger_map_load(&session.map[f], &map_flash, BT_MAP_RECORD_VERSION, bytes, n);
    }
    bt_session_use_settings(&session);
}

static int new_board(void **state)
{
    (void)state;
    memset(slots, 0, sizeof slots); // whatever was there before
    memset(record, 0, sizeof record);
    erases = programs = 0;
    worn = false;
    refused_finger = 0xFF;
    power_on();
    return 0;
}

// ---- commands ---------------------------------------------------------------------------------------------

static uint8_t begin(uint8_t finger, uint16_t bytes, uint32_t crc32)
{
    uint8_t payload[BT_BEGIN_MAP_BYTES];
    bt_msg_begin_map msg = {.req_id = 1, .finger = finger, .size_bytes = bytes, .crc32 = crc32};
    bt_msg_begin_map_pack(&msg, payload);
    return host_error(&session, BT_BEGIN_MAP_ID, payload, sizeof payload);
}

static uint8_t write_bytes(uint8_t finger, uint16_t offset, const uint8_t *data, size_t bytes)
{
    uint8_t payload[BT_WRITE_MAP_BYTES];
    bt_msg_write_map msg = {.req_id = 2, .finger = finger, .offset = offset};
    memset(msg.data, 0x5A, sizeof msg.data); // not what erased flash holds: the board is not to care
    memcpy(msg.data, data, bytes < PART ? bytes : PART);
    bt_msg_write_map_pack(&msg, payload);
    int erases_before = erases, programs_before = programs;
    uint8_t error = host_error(&session, BT_WRITE_MAP_ID, payload, sizeof payload);
    assert_true(erases - erases_before <= 1 && programs - programs_before <= 1); // nothing blocks for longer
    return error;
}

static uint8_t write_part(uint8_t finger, const uint8_t *blob, size_t bytes, size_t part)
{
    size_t at = part * PART;
    return write_bytes(finger, (uint16_t)at, blob + at, bytes - at);
}

static uint8_t end(uint8_t finger, uint32_t crc32)
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

static uint8_t clear(uint8_t finger)
{
    uint8_t payload[2] = {4, finger};
    return host_error(&session, BT_CLEAR_MAP_ID, payload, 2);
}

static uint8_t save(void)
{
    return host_error(&session, BT_SAVE_SETTINGS_ID, "\5", 1);
}

static bt_msg_map_info info(uint8_t finger)
{
    uint8_t payload[2] = {6, finger};
    bt_msg_map_info msg;
    const received_message *message = host_ask(&session, BT_GET_MAP_ID, payload, 2);
    assert_int_equal(message->id, BT_MAP_INFO_ID);
    bt_msg_map_info_unpack(&msg, message->payload);
    assert_true(msg.req_id == 6 && msg.finger == finger);
    return msg;
}

static size_t parts_of(size_t bytes)
{
    return (bytes + PART - 1) / PART;
}

static void write_all(uint8_t finger, const uint8_t *blob, size_t bytes)
{
    assert_int_equal(begin(finger, (uint16_t)bytes, bt_crc32(blob, bytes)), BT_ERROR_OK);
    for (size_t part = 0; part < parts_of(bytes); part++) {
        assert_int_equal(write_part(finger, blob, bytes, part), BT_ERROR_OK);
    }
}

static uint8_t upload(uint8_t finger, const uint8_t *blob, size_t bytes)
{
    write_all(finger, blob, bytes);
    return end(finger, bt_crc32(blob, bytes));
}

// The finger has this map, by what is told and by every byte; NULL: none.
static void assert_has(uint8_t finger, const uint8_t *blob, size_t bytes, uint8_t state)
{
    bt_msg_map_info its = info(finger);
    assert_int_equal(its.state, state);
    assert_int_equal(its.size_bytes, bytes);
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
        assert_int_equal(its.crc32, bt_crc32(blob, bytes));
        assert_int_equal(its.made_s, bt_get_u32(blob + 20));
        assert_memory_equal(its.serial, blob + 4, sizeof its.serial);
    }
}

static uint8_t blob[BT_MAP_MAX_BYTES], other[BT_MAP_MAX_BYTES];

// ---- from the host and back
// ----------------------------------------------------------------------------------

static void a_map_of_any_size_comes_back_as_it_was_sent(void **state)
{
    (void)state;
    for (int blocks = 1; blocks <= 7; blocks++) {
        size_t bytes = make_map(blob, (uint32_t)blocks, blocks, SENSOR);
        assert_int_equal(upload(2, blob, bytes), BT_ERROR_OK);
        assert_has(2, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    }
    size_t bytes = make_big_map(blob, 9);
    assert_true(bytes > BT_MAP_MAX_BYTES - BT_FLASH_SECTOR_BYTES);
    assert_int_equal(upload(2, blob, bytes), BT_ERROR_OK);
    assert_has(2, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    assert_has(1, NULL, 0, BT_CALIBRATION_STATE_NONE);
    assert_int_equal(host_error(&session, BT_READ_MAP_ID, "\1\1\0\0", 4), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(host_error(&session, BT_READ_MAP_ID, "\1\5\0\0", 4), BT_ERROR_NO_SUCH_FINGER);
}

static void parts_may_come_in_any_order_and_more_than_once(void **state)
{
    (void)state;
    uint64_t seed = 1;
    size_t bytes = make_big_map(blob, 1), parts = parts_of(bytes);
    uint32_t crc32 = bt_crc32(blob, bytes);
    assert_int_equal(begin(3, (uint16_t)bytes, crc32), BT_ERROR_OK);
    assert_int_equal(begin(3, (uint16_t)bytes, crc32), BT_ERROR_OK); // its reply was lost
    for (size_t k = 0; k < 20 * parts; k++) {
        assert_int_equal(write_part(3, blob, bytes, (size_t)(random_u64(&seed) % parts)), BT_ERROR_OK);
    }
    for (size_t part = parts; part-- > 0;) { // whatever chance left out
        assert_int_equal(write_part(3, blob, bytes, part), BT_ERROR_OK);
    }
    assert_int_equal(erases, BT_MAP_SLOT_BYTES / BT_FLASH_SECTOR_BYTES);
    assert_int_equal(programs, parts); // once each
    assert_int_equal(end(3, crc32), BT_ERROR_OK);
    assert_int_equal(end(3, crc32), BT_ERROR_OK); // its reply was lost
    assert_has(3, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

static void what_is_no_map_or_damaged_never_holds_and_the_old_one_stays(void **state)
{
    (void)state;
    size_t old = make_map(other, 1, 3, ""), bytes = make_map(blob, 2, 6, "");
    uint32_t crc32 = bt_crc32(blob, bytes);
    assert_int_equal(upload(0, other, old), BT_ERROR_OK);
    // A part is missing, each in turn; and that told again tells the same again, until it has come.
    for (size_t missing = 0; missing < parts_of(bytes); missing++) {
        assert_int_equal(begin(0, (uint16_t)bytes, crc32), BT_ERROR_OK);
        assert_int_equal(end(0, crc32), BT_ERROR_NOT_WHOLE);
        for (size_t part = 0; part < parts_of(bytes); part++) {
            if (part != missing) {
                assert_int_equal(write_part(0, blob, bytes, part), BT_ERROR_OK);
            }
        }
        assert_int_equal(end(0, crc32), BT_ERROR_NOT_WHOLE);
        assert_int_equal(end(0, crc32), BT_ERROR_NOT_WHOLE);
        assert_has(0, other, old, BT_CALIBRATION_STATE_IN_FORCE);
    }
    // A wrong byte, a wrong CRC.
    blob[bytes - 1] ^= 1;
    assert_int_equal(begin(0, (uint16_t)bytes, crc32), BT_ERROR_OK);
    for (size_t part = 0; part < parts_of(bytes); part++) {
        assert_int_equal(write_part(0, blob, bytes, part), BT_ERROR_OK);
    }
    assert_int_equal(end(0, crc32), BT_ERROR_NOT_WHOLE);
    assert_int_equal(end(0, bt_crc32(blob, bytes)), BT_ERROR_NOT_BEGUN);
    blob[bytes - 1] ^= 1;
    // Whole, but none that can be computed: of another version, with a block too many, a byte short.
    blob[0]++;
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OUT_OF_RANGE);
    blob[0]--;
    blob[2]++;
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OUT_OF_RANGE);
    blob[2]--;
    assert_int_equal(upload(0, blob, bytes - 1), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(end(0, bt_crc32(blob, bytes - 1)), BT_ERROR_OUT_OF_RANGE); // said again
    assert_has(0, other, old, BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

static void a_part_that_differs_from_what_is_there_is_refused_and_does_no_harm(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 4, ""), strange = make_map(other, 2, 4, "");
    write_all(0, blob, bytes);
    for (size_t part = 0; part < parts_of(bytes); part++) {
        assert_int_equal(write_part(0, other, strange, part), BT_ERROR_NOT_STORED);
    }
    assert_int_equal(end(0, bt_crc32(blob, bytes)), BT_ERROR_OK);
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

// ---- in the wrong moment
// -------------------------------------------------------------------------------------

static void nothing_is_written_that_was_not_begun(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, "");
    uint32_t crc32 = bt_crc32(blob, bytes);
    assert_int_equal(write_part(0, blob, bytes, 0), BT_ERROR_NOT_BEGUN);
    assert_int_equal(end(0, crc32), BT_ERROR_NOT_BEGUN);
    assert_int_equal(begin(0, (uint16_t)bytes, crc32), BT_ERROR_OK);
    assert_int_equal(write_part(1, blob, bytes, 0), BT_ERROR_NOT_BEGUN); // another finger's
    assert_int_equal(end(1, crc32), BT_ERROR_NOT_BEGUN);
    assert_int_equal(begin(1, (uint16_t)bytes, crc32), BT_ERROR_OK); // ends finger 0's
    assert_int_equal(write_part(0, blob, bytes, 0), BT_ERROR_NOT_BEGUN);
    assert_int_equal(programs, 0);
}

static void what_is_out_of_range_is_refused(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 3, "");
    assert_int_equal(begin(5, 24, 0), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(begin(0, 0, 0), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(begin(0, BT_MAP_MAX_BYTES + 1, 0), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(begin(0, UINT16_MAX, 0), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(begin(0, (uint16_t)bytes, 0), BT_ERROR_OK);
    static const uint16_t wrong[] = {1,         PART - 1, PART + 1, BT_MAP_MAX_BYTES, UINT16_MAX - PART + 1,
                                     UINT16_MAX};
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        assert_int_equal(write_bytes(0, wrong[k], blob, PART), BT_ERROR_OUT_OF_RANGE);
    }
    uint16_t behind = (uint16_t)(parts_of(bytes) * PART);
    assert_int_equal(write_bytes(0, behind, blob, PART), BT_ERROR_OUT_OF_RANGE);
    assert_true(erases == 0 && programs == 0);
}

static void nothing_changes_while_streaming(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, ""), more = make_map(other, 2, 4, "");
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    write_all(1, other, more);
    int before = programs;
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
    assert_int_equal(begin(0, (uint16_t)bytes, 0), BT_ERROR_BUSY);
    assert_int_equal(write_part(1, other, more, 0), BT_ERROR_BUSY);
    assert_int_equal(end(1, bt_crc32(other, more)), BT_ERROR_BUSY);
    assert_int_equal(clear(0), BT_ERROR_BUSY);
    assert_int_equal(programs, before);
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE); // asking is allowed
    assert_int_equal(stop(), BT_ERROR_OK);
    assert_int_equal(end(1, bt_crc32(other, more)), BT_ERROR_NOT_BEGUN);
    assert_int_equal(clear(0), BT_ERROR_OK);
    assert_int_equal(clear(0), BT_ERROR_OK); // harmless twice
    assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
}

static void every_way_out_ends_an_upload(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, "");
    for (int way = 0; way < 4; way++) {
        write_all(0, blob, bytes);
        if (way == 0) {
            assert_int_equal(stop(), BT_ERROR_OK);
        } else if (way == 1) {
            assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
            assert_int_equal(stop(), BT_ERROR_OK);
        } else if (way == 2) {
            bt_session_link_down(&session);
        } else {
            assert_int_equal(begin(4, 24, 0), BT_ERROR_OK);
        }
        assert_int_equal(end(0, bt_crc32(blob, bytes)), BT_ERROR_NOT_BEGUN);
        assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
    }
}

static void a_board_without_room_says_so(void **state)
{
    (void)state;
    (void)new_session(NULL);
    assert_int_equal(begin(0, 24, 0), BT_ERROR_NOT_HERE);
    assert_int_equal(end(0, 0), BT_ERROR_NOT_HERE);
    assert_int_equal(info(0).state, BT_CALIBRATION_STATE_NONE);
}

// ---- whose it is
// ---------------------------------------------------------------------------------------------

static void another_sensors_is_refused_unless_it_is_for_any(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, "BTEMU00000000043");
    assert_int_equal(upload(2, blob, bytes), BT_ERROR_OTHER_SENSOR);
    assert_int_equal(end(2, bt_crc32(blob, bytes)), BT_ERROR_OTHER_SENSOR); // said again
    bytes = make_map(blob, 1, 2, SENSOR);
    assert_int_equal(upload(1, blob, bytes), BT_ERROR_OTHER_SENSOR); // none is there
    assert_has(2, NULL, 0, BT_CALIBRATION_STATE_NONE);
    bytes = make_map(blob, 1, 2, "");
    assert_int_equal(upload(2, blob, bytes), BT_ERROR_OK);
    assert_has(2, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

static void a_sensor_that_is_unplugged_takes_its_map_along_but_not_while_streaming(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, SENSOR);
    assert_int_equal(upload(2, blob, bytes), BT_ERROR_OK);
    host_round(&session, 1 << 2, 2000);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 2, 0), BT_ERROR_OK);
    for (int k = 0; k < BT_UNPLUGGED_ROUNDS; k++) {
        host_round(&session, 0, 2000);
    }
    assert_has(2, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(stop(), BT_ERROR_OK);
    assert_has(2, blob, bytes, BT_CALIBRATION_STATE_OTHER_SENSOR);
}

// ---- what is kept
// --------------------------------------------------------------------------------------------

static void what_was_not_saved_is_gone_at_the_next_boot(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, ""), more = make_map(other, 2, 5, "");
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    assert_int_equal(save(), BT_ERROR_OK);
    assert_int_equal(upload(0, other, more), BT_ERROR_OK);
    assert_int_equal(upload(1, other, more), BT_ERROR_OK);
    power_on();
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    assert_has(1, NULL, 0, BT_CALIBRATION_STATE_NONE);
    assert_int_equal(clear(0), BT_ERROR_OK);
    power_on();
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(clear(0), BT_ERROR_OK);
    assert_int_equal(save(), BT_ERROR_OK);
    power_on();
    assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
}

static void a_record_that_cannot_be_is_no_map(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 2, "");
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    assert_int_equal(save(), BT_ERROR_OK);
    const bt_map_place good = record[0];
    const bt_map_place bad[] = {
        {good.slot, good.bytes, good.crc32 ^ 1},
        {good.slot, (uint16_t)(good.bytes - 1), good.crc32},
        {BT_MAP_SLOTS, good.bytes, good.crc32},
        {good.slot, BT_MAP_MAX_BYTES + 1, good.crc32},
        {(uint8_t)(good.slot - 1), good.bytes, good.crc32},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        record[0] = bad[k];
        power_on();
        assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
    }
    // A record of a later version is not understood, but its slot is not written to either.
    uint8_t packed[BT_MAP_RECORD_BYTES + 4] = {0};
    (void)bt_map_place_pack(&good, packed);
    record[0] = (bt_map_place){0};
    power_on();
    bt_finger_map_load(&session.map[0], &map_flash, BT_MAP_RECORD_VERSION + 1, packed, sizeof packed);
    for (int k = 0; k < 3 * BT_MAP_SLOTS; k++) {
        size_t more = make_map(other, (uint32_t)k, 2, "");
        assert_int_equal(upload(1, other, more), BT_ERROR_OK);
        assert_int_equal(save(), BT_ERROR_OK);
    }
    record[0] = good;
    power_on();
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

static void flash_that_takes_nothing_is_told_and_passed_by(void **state)
{
    (void)state;
    size_t bytes = make_map(blob, 1, 3, ""), more = make_map(other, 2, 3, "");
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    uint8_t before = session.map[0].place.slot;
    worn = true;
    assert_int_equal(begin(0, (uint16_t)more, bt_crc32(other, more)), BT_ERROR_OK);
    assert_int_equal(write_part(0, other, more, 0), BT_ERROR_NOT_STORED);
    assert_int_equal(write_part(0, other, more, 0), BT_ERROR_NOT_STORED);
    uint8_t tried = session.upload.place.slot;
    worn = false;
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(upload(0, other, more), BT_ERROR_OK);
    assert_true(session.map[0].place.slot != tried && session.map[0].place.slot != before);
    // A record that is not kept leaves the stored map where it is, and the new one is tried again.
    assert_int_equal(save(), BT_ERROR_OK);
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    refused_finger = 0;
    assert_int_equal(save(), BT_ERROR_NOT_STORED);
    assert_int_equal(save(), BT_ERROR_NOT_STORED);
    power_on();
    assert_has(0, other, more, BT_CALIBRATION_STATE_IN_FORCE);
}

static void there_is_room_for_one_more_when_every_finger_has_another_than_it_has_stored(void **state)
{
    (void)state;
    for (uint32_t turn = 0; turn < 4; turn++) {
        for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
            size_t bytes = make_map(blob, 10 * turn + f, 2, "");
            assert_int_equal(upload(f, blob, bytes), BT_ERROR_OK);
            assert_has(f, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
        }
        assert_int_equal(turn == 0 ? save() : BT_ERROR_OK, BT_ERROR_OK);
    }
    power_on();
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        size_t bytes = make_map(blob, f, 2, "");
        assert_has(f, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    }
}

// Uploads, broken off or not, clears, saves and boots at random: what is in force and what is stored is what
// it should be, byte for byte, every time. numbers: of the map that a finger has and has stored; 0: none.
static void whatever_happens_nothing_that_is_kept_is_written_to(void **state)
{
    (void)state;
    uint64_t seed = 7;
    uint32_t has[BT_MAX_FINGERS] = {0}, stored[BT_MAX_FINGERS] = {0};
    for (uint32_t number = 1; number < 3000; number++) {
        uint8_t finger = (uint8_t)random_range(&seed, 0, BT_MAX_FINGERS - 1);
        size_t bytes = make_map(blob, number, 1 + (int)(number % 7), "");
        switch (random_u64(&seed) % 8) {
        case 0:
            assert_int_equal(save(), BT_ERROR_OK);
            memcpy(stored, has, sizeof has);
            break;
        case 1:
            power_on();
            memcpy(has, stored, sizeof has);
            break;
        case 2:
            assert_int_equal(clear(finger), BT_ERROR_OK);
            has[finger] = 0;
            break;
        case 3: // given up in the middle
            assert_int_equal(begin(finger, (uint16_t)bytes, bt_crc32(blob, bytes)), BT_ERROR_OK);
            assert_int_equal(write_part(finger, blob, bytes, 0), BT_ERROR_OK);
            break;
        default:
            assert_int_equal(upload(finger, blob, bytes), BT_ERROR_OK);
            has[finger] = number;
            break;
        }
        for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
            size_t size = has[f] == 0 ? 0 : make_map(other, has[f], 1 + (int)(has[f] % 7), "");
            assert_has(f, has[f] == 0 ? NULL : other, size, has[f] == 0 ? 0 : BT_CALIBRATION_STATE_IN_FORCE);
        }
    }
}

#define T(name) cmocka_unit_test_setup(name, new_board)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_map_of_any_size_comes_back_as_it_was_sent),
        T(parts_may_come_in_any_order_and_more_than_once),
        T(what_is_no_map_or_damaged_never_holds_and_the_old_one_stays),
        T(a_part_that_differs_from_what_is_there_is_refused_and_does_no_harm),
        T(nothing_is_written_that_was_not_begun),
        T(what_is_out_of_range_is_refused),
        T(nothing_changes_while_streaming),
        T(every_way_out_ends_an_upload),
        T(a_board_without_room_says_so),
        T(another_sensors_is_refused_unless_it_is_for_any),
        T(a_sensor_that_is_unplugged_takes_its_map_along_but_not_while_streaming),
        T(what_was_not_saved_is_gone_at_the_next_boot),
        T(a_record_that_cannot_be_is_no_map),
        T(flash_that_takes_nothing_is_told_and_passed_by),
        T(there_is_room_for_one_more_when_every_finger_has_another_than_it_has_stored),
        T(whatever_happens_nothing_that_is_kept_is_written_to),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
