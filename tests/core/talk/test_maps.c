// Wrench maps on their way to a finger, through the session: in any order, with repetitions, interrupted, in
// the wrong moment, damaged, of another sensor.
#include "map_board.h"

// ---- from the host and back ---------------------------------------------------------------------------

TEST(a_map_of_any_size_comes_back_as_it_was_sent)
{
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

TEST(parts_may_come_in_any_order_and_more_than_once)
{
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
    assert_false(session.upload.open);
    assert_int_equal(end(3, crc32), BT_ERROR_OK); // its reply was lost
    assert_int_equal(write_part(3, blob, bytes, 0), BT_ERROR_NOT_BEGUN);
    assert_has(3, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

TEST(what_is_no_map_or_damaged_never_holds_and_the_old_one_stays)
{
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

TEST(a_part_that_differs_from_what_is_there_is_refused_and_does_no_harm)
{
    size_t bytes = make_map(blob, 1, 4, ""), strange = make_map(other, 2, 4, "");
    write_all(0, blob, bytes);
    for (size_t part = 0; part < parts_of(bytes); part++) {
        assert_int_equal(write_part(0, other, strange, part), BT_ERROR_NOT_STORED);
    }
    assert_int_equal(end(0, bt_crc32(blob, bytes)), BT_ERROR_OK);
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
}

// ---- in the wrong moment ------------------------------------------------------------------------------

TEST(nothing_is_written_that_was_not_begun)
{
    size_t bytes = make_map(blob, 1, 2, "");
    uint32_t crc32 = bt_crc32(blob, bytes);
    assert_int_equal(write_part(0, blob, bytes, 0), BT_ERROR_NOT_BEGUN);
    assert_int_equal(end(0, crc32), BT_ERROR_NOT_BEGUN);
    assert_int_equal(end(0, 0), BT_ERROR_NOT_BEGUN); // what no map has for its CRC
    assert_int_equal(begin(0, (uint16_t)bytes, crc32), BT_ERROR_OK);
    assert_int_equal(write_part(1, blob, bytes, 0), BT_ERROR_NOT_BEGUN); // another finger's
    assert_int_equal(end(1, crc32), BT_ERROR_NOT_BEGUN);
    assert_int_equal(begin(1, (uint16_t)bytes, crc32), BT_ERROR_OK); // ends finger 0's
    assert_int_equal(write_part(0, blob, bytes, 0), BT_ERROR_NOT_BEGUN);
    assert_int_equal(programs, 0);
}

TEST(what_is_out_of_range_is_refused)
{
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

TEST(every_way_out_ends_an_upload)
{
    size_t bytes = make_map(blob, 1, 2, "");
    for (int way = 0; way < 4; way++) {
        write_all(0, blob, bytes);
        if (way == 0) {
            assert_int_equal(stop(), BT_ERROR_OK);
        } else if (way == 1) {
            assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
            assert_int_equal(stop(), BT_ERROR_OK);
        } else if (way == 2) {
            bt_session_link_down(&session, 0);
        } else {
            assert_int_equal(begin(4, 24, 0), BT_ERROR_OK);
        }
        assert_int_equal(end(0, bt_crc32(blob, bytes)), BT_ERROR_NOT_BEGUN);
        assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
    }
}

// ---- whose it is --------------------------------------------------------------------------------------

TEST(another_sensors_is_refused_unless_it_is_for_any)
{
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

TEST(another_sensor_has_not_the_map_but_not_while_streaming)
{
    size_t bytes = make_map(blob, 1, 2, SENSOR);
    assert_int_equal(upload(2, blob, bytes), BT_ERROR_OK);
    host_round(&session, 1 << 2, 2000);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 2, 0), BT_ERROR_OK);
    for (int k = 0; k < BT_UNPLUGGED_ROUNDS; k++) {
        host_round(&session, 0, 2000);
    }
    bt_sensors_answer(&session, 2, (const uint8_t[BT_SERIAL_BYTES]){"BT-another-one"});
    assert_has(2, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    assert_true(bt_sensors_refused(&session, 2));
    assert_int_equal(stop(), BT_ERROR_OK);
    assert_has(2, blob, bytes, BT_CALIBRATION_STATE_OTHER_SENSOR);
}

TEST(a_map_is_not_whole_until_its_last_byte_has_come)
{
    memset(blob, 0xFF, sizeof blob); // as flash reads where nothing was written: the CRC cannot tell
    for (size_t over = 1; over < PART; over++) { // bytes of the last part
        size_t bytes = 2 * PART + over;
        uint32_t crc32 = bt_crc32(blob, bytes);
        assert_int_equal(begin(0, (uint16_t)bytes, crc32), BT_ERROR_OK);
        assert_int_equal(write_part(0, blob, bytes, 0), BT_ERROR_OK);
        assert_int_equal(write_part(0, blob, bytes, 1), BT_ERROR_OK);
        assert_int_equal(end(0, crc32), BT_ERROR_NOT_WHOLE);
        assert_int_equal(write_part(0, blob, bytes, 2), BT_ERROR_OK);
        assert_int_equal(end(0, crc32), BT_ERROR_OUT_OF_RANGE); // whole, and no map
    }
}

int main(void)
{
    return run_all(NULL, new_board);
}
