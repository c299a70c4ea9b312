// A map's way through the whole firmware into flash, with power cut at every byte of every erase and program:
// at the next boot each finger has the old map or the new one, whole, and the next upload goes as if nothing
// had been.
#include "map_blob.h"
#include "rig.h"

#define PART BT_MAP_PART_BYTES

static void command(uint8_t id, const void *payload)
{
    assert_int_equal(ask(id, payload), BT_ERROR_OK);
}

static void power_on(void)
{
    bt_deframer_reset(&host.deframer);
    power_cycle();
    command(BT_STOP_ID, "\1");
}

static uint8_t blob[BT_MAP_MAX_BYTES];
static uint8_t before[BT_KEPT_BYTES];

static void upload(uint8_t finger, size_t bytes)
{
    uint8_t payload[BT_FRAME_MAX_BYTES];
    uint32_t crc32 = bt_crc32(blob, bytes);
    bt_msg_begin_map begin = {.req_id = 1, .finger = finger, .size_bytes = (uint16_t)bytes, .crc32 = crc32};
    bt_msg_begin_map_pack(&begin, payload);
    command(BT_BEGIN_MAP_ID, payload);
    for (size_t at = 0; at < bytes; at += PART) {
        bt_msg_write_map write = {.req_id = 2, .finger = finger, .offset = (uint16_t)at};
        memcpy(write.data, blob + at, bytes - at < PART ? bytes - at : PART);
        bt_msg_write_map_pack(&write, payload);
        command(BT_WRITE_MAP_ID, payload);
    }
    bt_msg_end_map end = {.req_id = 3, .finger = finger, .crc32 = crc32};
    bt_msg_end_map_pack(&end, payload);
    (void)ask(BT_END_MAP_ID, payload);
    assert_int_equal(host.id, BT_MAP_INFO_ID);
}

static void upload_and_save(uint8_t finger, uint32_t number, int blocks)
{
    upload(finger, make_map(blob, number, blocks, ""));
    command(BT_SAVE_SETTINGS_ID, "\4");
}

// The map that a finger has, after looking at all bytes; 0: none.
static uint32_t has(uint8_t finger, int blocks)
{
    static _Alignas(4) uint8_t want[BT_MAP_MAX_BYTES];
    const bt_finger_map *kept_map = &gateway.session.map[finger];
    if (gateway.session.map_state[finger] == BT_CALIBRATION_STATE_NONE) {
        return 0;
    }
    assert_int_equal(kept_map->place.bytes, make_map(want, kept_map->map.made_s, blocks, ""));
    assert_memory_equal(bt_map_bytes(&gateway.map_flash, &kept_map->place), want, kept_map->place.bytes);
    return kept_map->map.made_s;
}

// `left` counts down to the cut.
static bool upload_and_save_with_cut(uint32_t number, int blocks, long *left, long cut)
{
    *left = cut;
    if (setjmp(fake.flash.power_fails) != 0) {
        *left = -1;
        return false;
    }
    upload_and_save(0, number, blocks);
    *left = -1;
    return true;
}

// Finger 0 has this map and gets the next ones, all of this size; finger 1 keeps the map it has.
static void cut_everywhere(int blocks, uint32_t first, uint32_t saves, long at_least)
{
    long cuts = 0;
    for (uint32_t number = first + 1; number <= first + saves; number++) {
        memcpy(before, fake.kept, sizeof before);
        long cut = 0;
        for (; !upload_and_save_with_cut(number, blocks, &fake.flash.bytes_left, cut); cut++) {
            power_on();
            uint32_t found = has(0, blocks);
            assert_true(found == number - 1 || found == number);
            assert_int_equal(has(1, 3), 77);
            if (cut % 17 == 0) { // the half record left by the cut is no obstacle
                upload_and_save(0, 500, blocks);
                power_on();
                assert_int_equal(has(0, blocks), 500);
                assert_int_equal(has(1, 3), 77);
            }
            memcpy(fake.kept, before, sizeof before);
            power_on();
        }
        cuts += cut;
        power_on();
        assert_int_equal(has(0, blocks), number);
    }
    assert_true(cuts >= at_least);
}

BEFORE_EACH(powered)
{
    boot(START_NS);
    power_on();
    upload_and_save(1, 77, 3);
}

TEST(a_cut_at_any_byte_leaves_the_old_map_or_the_new)
{
    upload_and_save(0, 1, 2);
    cut_everywhere(2, 1, 2, 2 * (BT_FLASH_SECTOR_BYTES + 3 * BT_FLASH_PAGE_BYTES));
}

TEST(nor_do_half_done_bytes_matter)
{
    fake.flash.ragged = true;
    upload_and_save(0, 1, 5);
    cut_everywhere(5, 1, 2, 2 * (BT_FLASH_SECTOR_BYTES + 5 * BT_FLASH_PAGE_BYTES));
}

TEST(nor_while_the_records_sector_changes)
{
    uint32_t number = 1;
    int erases;
    upload_and_save(0, number, 1);
    do { // until the save after this one needs the other sector too, beside the map's
        memcpy(before, fake.kept, sizeof before);
        erases = fake.flash.erases;
        upload_and_save(0, ++number, 1);
    } while (fake.flash.erases - erases == 1);
    memcpy(fake.kept, before, sizeof before);
    power_on();
    cut_everywhere(1, number - 1, 1, 2 * BT_FLASH_SECTOR_BYTES + 5 * BT_FLASH_PAGE_BYTES);
}

// Before every erase and program, and thrice inside of each, with cells done in no order: seed 17.
TEST(nor_where_and_how_an_operation_is_cut)
{
    int at = 0, within = 0;
    fake.flash.seed = 17;
    upload_and_save(0, 1, 5);
    for (uint32_t number = 2; number <= 6; number++) {
        memcpy(before, fake.kept, sizeof before);
        for (int turn = 0; turn < 4; turn++) {
            fake.flash.inside = turn > 0;
            memcpy(fake.kept, before, sizeof before);
            power_on();
            for (long cut = 0; !upload_and_save_with_cut(number, 5, &fake.flash.operations_left, cut);
                 cut++) {
                *(fake.flash.inside ? &within : &at) += 1;
                power_on();
                uint32_t found = has(0, 5);
                assert_true(found == number - 1 || found == number);
                assert_int_equal(has(1, 3), 77);
                upload_and_save(0, 500, 5); // the half record left by the cut is no obstacle
                power_on();
                assert_int_equal(has(0, 5), 500);
                memcpy(fake.kept, before, sizeof before);
                power_on();
            }
        }
    }
    print_message("maps: power cut before %d operations, inside %d\n", at, within);
    assert_in_range(at, 30, 1000);
    assert_in_range(within, 100, 1000);
}

TEST(saved_maps_hold_for_their_own_sensors_alone)
{
    char serial[17] = {0};
    const bt_session *session = &gateway.session;
    memcpy(serial, session->info[3].serial, 16);
    upload(3, make_map(blob, 5, 4, serial));
    upload(4, make_big_map(blob, 6));
    command(BT_SAVE_SETTINGS_ID, "\4");
    power_on();
    assert_int_equal(session->map_state[3], BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(session->map_state[4], BT_CALIBRATION_STATE_IN_FORCE);
    fake.bus.sensor[3].serial[15] ^= 3;
    power_on();
    assert_int_equal(session->map_state[3], BT_CALIBRATION_STATE_OTHER_SENSOR);
    assert_int_equal(session->map[3].map.made_s, 5); // kept
    fake.bus.sensor[3].serial[15] ^= 3;
    power_on();
    assert_int_equal(session->map_state[3], BT_CALIBRATION_STATE_IN_FORCE);
}
