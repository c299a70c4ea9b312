// Uploads of wrench maps at the edges, and the kept maps, over the slots of a small flash.
#include "map_board.h"

// Finger 0's record, as it is stored.
static void keep_record(const bt_map_place *place)
{
    uint8_t packed[BT_MAP_RECORD_BYTES];
    const size_t bytes = bt_map_place_pack(place, packed);
    assert_true(bt_storage_write(&flash, BT_RECORD_MAP, BT_MAP_RECORD_VERSION, packed, bytes));
}

TEST(parts_may_come_in_any_order_and_more_than_once)
{
    uint64_t seed = 1;
    size_t bytes = make_big_map(blob, 1), parts = parts_of(bytes);
    uint32_t crc32 = bt_crc32(blob, bytes);
    assert_int_equal(begin(3, (uint16_t)bytes, crc32), BT_ERROR_OK);
    assert_int_equal(begin(3, (uint16_t)bytes, crc32), BT_ERROR_OK); // the reply was lost
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
    assert_int_equal(end(3, crc32), BT_ERROR_OK); // the reply was lost
    assert_int_equal(write_part(3, blob, bytes, 0), BT_ERROR_NOT_BEGUN);
    assert_has(3, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
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

TEST(a_record_that_cannot_be_is_no_map)
{
    size_t bytes = make_map(blob, 1, 2, "");
    assert_int_equal(upload(0, blob, bytes), BT_ERROR_OK);
    assert_int_equal(save(), BT_ERROR_OK);
    const bt_map_place good = session.map[0].place;
    const bt_map_place bad[] = {
        {good.slot, good.bytes, good.crc32 ^ 1},
        {good.slot, (uint16_t)(good.bytes - 1), good.crc32},
        {BT_MAP_SLOTS, good.bytes, good.crc32},
        {good.slot, BT_MAP_MAX_BYTES + 1, good.crc32},
        {(uint8_t)(good.slot - 1), good.bytes, good.crc32},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        keep_record(&bad[k]);
        power_on();
        assert_false(stored_maps_are_good); // reported as damaged storage
        assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
    }
    // A record of a later version is not understood, but the board does not overwrite the slot either.
    uint8_t packed[BT_MAP_RECORD_BYTES + 4] = {0};
    (void)bt_map_place_pack(&good, packed);
    assert_true(bt_storage_write(&flash, BT_RECORD_MAP, BT_MAP_RECORD_VERSION + 1, packed, sizeof packed));
    power_on();
    for (int k = 0; k < 3 * BT_MAP_SLOTS; k++) {
        size_t more = make_map(other, (uint32_t)k, 2, "");
        assert_int_equal(upload(1, other, more), BT_ERROR_OK);
        assert_int_equal(save(), BT_ERROR_OK);
    }
    keep_record(&good);
    power_on();
    assert_true(stored_maps_are_good);
    assert_has(0, blob, bytes, BT_CALIBRATION_STATE_IN_FORCE);
    SLOTS[good.slot * (size_t)BT_MAP_SLOT_BYTES + bytes - 1] ^= 1;
    power_on();
    assert_false(stored_maps_are_good);
    assert_has(0, NULL, 0, BT_CALIBRATION_STATE_NONE);
    assert_int_equal(session.map[0].stored_slot, good.slot); // it is not written to
}

TEST(flash_that_takes_nothing_is_told_and_passed_by)
{
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
    refused_record = BT_RECORD_MAP;
    assert_int_equal(save(), BT_ERROR_NOT_STORED);
    assert_int_equal(save(), BT_ERROR_NOT_STORED);
    power_on();
    assert_has(0, other, more, BT_CALIBRATION_STATE_IN_FORCE);
    // A map that is stored no more leaves the slot to the next.
    assert_int_equal(session.map[0].stored_slot, session.map[0].place.slot);
    assert_int_equal(clear(0), BT_ERROR_OK);
    assert_int_not_equal(session.map[0].stored_slot, BT_MAP_SLOTS);
    refused_record = 0;
    assert_int_equal(save(), BT_ERROR_OK);
    assert_int_equal(session.map[0].stored_slot, BT_MAP_SLOTS);
    // A stored map is not written again.
    refused_record = BT_RECORD_MAP;
    assert_int_equal(save(), BT_ERROR_OK);
    refused_record = 0;
}

// Uploads, broken off or not, clears, saves and boots at random: the map in force and the stored map are the
// expected ones, byte for byte, every time. numbers: of the map in force and of the stored one; 0: none.
TEST(whatever_happens_nothing_that_is_kept_is_written_to)
{
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
