// A tape that comes while it is played: the order is what counts, and all fingers stay in one slot.
#include "support.h"

#include "stream.h"

#define FINGERS 3
#define ROUNDS  4
#define SAMPLES (FINGERS * BT_SLOTS * 2 + 5) // room for two rounds, and some that make no round

static bt_emu_stream stream;
static uint16_t ring[SAMPLES];

// Every place on the tape has a count of its own.
static uint16_t count_at(uint32_t slot, uint32_t finger)
{
    return (uint16_t)((slot * FINGERS + finger) % 4001);
}

static uint32_t put(uint32_t from, uint32_t slots)
{
    uint8_t bytes[2 * FINGERS * BT_SLOTS];
    for (uint32_t k = 0; k < slots * FINGERS; k++) {
        uint16_t count = count_at(from + k / FINGERS, k % FINGERS);
        bytes[2 * k] = (uint8_t)count;
        bytes[2 * k + 1] = (uint8_t)(count >> 8);
    }
    return bt_emu_stream_put(&stream, FINGERS, bytes, slots) ? slots : 0;
}

static uint16_t ask(uint8_t finger, uint32_t slot)
{
    uint8_t command = bt_channel_command[bt_slot_channel[slot % BT_SLOTS]];
    return bt_emu_stream_count(&stream, finger, (command & 0x7E) >> 1, 0);
}

static int empty(void **state)
{
    (void)state;
    bt_emu_stream_init(&stream, ring, SAMPLES);
    return 0;
}

static void test_every_finger_gets_every_slot_over_the_rings_end(void **state)
{
    (void)state;
    uint32_t put_in = 0;
    for (uint32_t slot = 0; slot < ROUNDS * BT_SLOTS; slot++) {
        put_in += put_in - slot < 2 ? put(put_in, 7) : 0;
        for (uint8_t f = 0; f < FINGERS; f++) {
            assert_int_equal(ask(f, slot), count_at(slot, f));
        }
        assert_int_equal(stream.at, slot);
    }
    assert_int_equal(stream.starved, 0);
}

static void test_a_slot_that_is_left_out_moves_nothing(void **state)
{
    (void)state;
    (void)put(0, BT_SLOTS);
    assert_int_equal(ask(0, 0), count_at(0, 0));
    assert_int_equal(ask(0, 5), count_at(5, 0)); // 1 to 4 were never asked for
    assert_int_equal(ask(2, 5), count_at(5, 2)); // by another finger, which had nothing before
    assert_int_equal(ask(0, 6), count_at(6, 0));
}

static void test_what_has_not_come_is_silence_and_the_order_stays(void **state)
{
    (void)state;
    (void)put(0, 2);
    (void)ask(0, 0);
    (void)ask(0, 1);
    assert_int_equal(ask(0, 2), BT_EMU_FAULT_STUCK_LOW);
    assert_int_equal(ask(1, 2), BT_EMU_FAULT_STUCK_LOW);
    assert_int_equal(stream.starved, 2);
    (void)put(2, 1);
    assert_int_equal(ask(0, 2), count_at(2, 0));
}

static void test_room_is_told_and_kept(void **state)
{
    (void)state;
    assert_int_equal(put(0, BT_SLOTS), BT_SLOTS);
    assert_int_equal(bt_emu_stream_room(&stream), BT_SLOTS);
    assert_int_equal(put(BT_SLOTS, BT_SLOTS), BT_SLOTS);
    assert_int_equal(put(2 * BT_SLOTS, 1), 0);
    assert_false(bt_emu_stream_put(&stream, FINGERS + 1, (const uint8_t[8]){0}, 1));
    (void)ask(0, 0);
    (void)ask(0, 1);
    assert_int_equal(bt_emu_stream_room(&stream), 1); // slot 1 may be asked for by the others yet
}

static void test_a_fault_hides_the_tape_and_does_not_hold_it_up(void **state)
{
    (void)state;
    (void)put(0, 4);
    stream.fault[1] = BT_EMU_FAULT_BAD_PARITY;
    assert_int_equal(ask(1, 0), BT_EMU_FAULT_BAD_PARITY);
    assert_int_equal(bt_emu_stream_count(&stream, 1, BT_EMU_LINE, 0), BT_EMU_FAULT_BAD_PARITY);
    assert_int_equal(ask(0, 0), count_at(0, 0));
    stream.fault[1] = BT_EMU_FAULT_NONE;
    assert_int_equal(ask(1, 1), count_at(1, 1));
    assert_int_equal(bt_emu_stream_count(&stream, 1, BT_EMU_LINE, 0), 0);
}

static void test_a_channel_that_no_slot_has_and_a_finger_that_is_not_on_the_tape(void **state)
{
    (void)state;
    (void)put(0, 4);
    assert_int_equal(bt_emu_stream_count(&stream, 0, 63, 0), BT_EMU_FAULT_NO_CHANNEL);
    assert_int_equal(ask(FINGERS, 0), BT_EMU_FAULT_STUCK_LOW);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_every_finger_gets_every_slot_over_the_rings_end, empty),
        cmocka_unit_test_setup(test_a_slot_that_is_left_out_moves_nothing, empty),
        cmocka_unit_test_setup(test_what_has_not_come_is_silence_and_the_order_stays, empty),
        cmocka_unit_test_setup(test_room_is_told_and_kept, empty),
        cmocka_unit_test_setup(test_a_fault_hides_the_tape_and_does_not_hold_it_up, empty),
        cmocka_unit_test_setup(test_a_channel_that_no_slot_has_and_a_finger_that_is_not_on_the_tape, empty),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
