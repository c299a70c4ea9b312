// A tape that comes while it is played: the order counts, and all fingers stay in one slot.
#include "support.h"

#include "in_order.h"

#define FINGERS 3
#define ROUNDS  4
#define SAMPLES (FINGERS * BT_SLOTS * 2 + 5) // room for two rounds, and some that make no round

static bt_emu_stream stream;
static uint16_t ring[SAMPLES];

// Every place on the tape has a different count.
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
    return bt_emu_stream_in_order(&stream, finger, (uint8_t)((command & 0x7E) >> 1), 0);
}

BEFORE_EACH(empty)
{
    bt_emu_stream_init(&stream, ring, SAMPLES);
}

TEST(test_every_finger_gets_every_slot_over_the_rings_end)
{
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

TEST(test_what_has_not_come_is_silence_and_the_order_stays)
{
    (void)put(0, 2);
    (void)ask(0, 0);
    (void)ask(0, 1);
    assert_int_equal(ask(0, 2), BT_EMU_FAULT_STUCK_LOW);
    assert_int_equal(ask(1, 2), BT_EMU_FAULT_STUCK_LOW);
    assert_int_equal(stream.starved, 2);
    (void)put(2, 1);
    assert_int_equal(ask(0, 2), count_at(2, 0));
}

TEST(test_room_is_told_and_kept)
{
    assert_int_equal(put(0, BT_SLOTS), BT_SLOTS);
    assert_int_equal(bt_emu_stream_room(&stream), BT_SLOTS);
    assert_int_equal(put(BT_SLOTS, BT_SLOTS), BT_SLOTS);
    assert_int_equal(put(2 * BT_SLOTS, 1), 0);
    assert_false(bt_emu_stream_put(&stream, FINGERS + 1, (const uint8_t[8]){0}, 1));
    (void)ask(0, 0);
    (void)ask(0, 1);
    assert_int_equal(bt_emu_stream_room(&stream), 1); // slot 1 may be asked for by the others yet
}

TEST(test_a_fault_hides_the_tape_and_does_not_hold_it_up)
{
    (void)put(0, 4);
    stream.fault[1] = BT_EMU_FAULT_BAD_PARITY;
    assert_int_equal(ask(1, 0), BT_EMU_FAULT_BAD_PARITY);
    assert_int_equal(bt_emu_stream_in_order(&stream, 1, BT_EMU_LINE, 0), BT_EMU_FAULT_BAD_PARITY);
    assert_int_equal(ask(0, 0), count_at(0, 0));
    stream.fault[1] = BT_EMU_FAULT_NONE;
    assert_int_equal(ask(1, 1), count_at(1, 1));
    assert_int_equal(bt_emu_stream_in_order(&stream, 1, BT_EMU_LINE, 0), 0);
}

TEST(test_a_channel_that_no_slot_has_and_a_finger_that_is_not_on_the_tape)
{
    (void)put(0, 4);
    assert_int_equal(bt_emu_stream_in_order(&stream, 0, 63, 0), BT_EMU_FAULT_NO_CHANNEL);
    assert_int_equal(ask(FINGERS, 0), BT_EMU_FAULT_STUCK_LOW);
}

static void query_serial(uint8_t finger)
{
    (void)bt_emu_stream_in_order(&stream, finger, BT_EMU_LINE, 0);
}

TEST(test_behind_a_hold_all_fingers_begin_in_the_round_after_all_were_asked_who_they_are)
{
    (void)put(0, BT_SLOTS);
    (void)put(BT_SLOTS, BT_SLOTS);
    stream.hold = BT_SLOTS;
    for (uint32_t slot = 0; slot < BT_SLOTS; slot++) {
        assert_int_equal(ask(0, slot), count_at(slot, 0));
    }
    assert_int_equal(ask(0, BT_SLOTS), BT_EMU_FAULT_STUCK_LOW);
    stream.hold = BT_EMU_NO_HOLD;
    for (uint8_t f = 0; f < FINGERS; f++) {
        assert_int_equal(ask(f, 1), BT_EMU_FAULT_STUCK_LOW); // in the middle of a round
    }
    query_serial(0);
    query_serial(1);
    assert_int_equal(ask(2, 0), BT_EMU_FAULT_STUCK_LOW); // one of them is sampled meanwhile
    assert_int_equal(ask(0, 0), BT_EMU_FAULT_STUCK_LOW);
    for (uint8_t f = 0; f < FINGERS; f++) {
        query_serial(f);
    }
    for (uint32_t slot = BT_SLOTS; slot < 2 * BT_SLOTS; slot++) {
        for (uint8_t f = 0; f < FINGERS; f++) {
            assert_int_equal(ask(f, slot), count_at(slot, f));
        }
    }
}

TEST(test_a_tape_is_whole_until_some_of_it_is_overwritten)
{
    (void)put(0, BT_SLOTS - 1);
    assert_true(bt_emu_stream_whole(&stream) == NULL); // no whole round
    (void)put(BT_SLOTS - 1, BT_SLOTS);
    (void)put(2 * BT_SLOTS - 1, 1);
    assert_true(bt_emu_stream_whole(&stream) == ring);
    for (uint32_t slot = 0; slot <= BT_SLOTS; slot++) {
        (void)ask(0, slot);
    }
    (void)put(2 * BT_SLOTS, BT_SLOTS);
    assert_true(bt_emu_stream_whole(&stream) == NULL);
}

// A bus with rounds of this length; returns the tape's round that the last one got.
static uint32_t play_by_time(uint32_t rounds, uint32_t round_us)
{
    static uint16_t kept[8 * FINGERS * BT_SLOTS];
    for (uint32_t k = 0; k < 8 * FINGERS * BT_SLOTS; k++) {
        kept[k] = count_at(k / FINGERS, k % FINGERS);
    }
    bt_emu_stream_loop(&stream, kept, FINGERS, 8 * BT_SLOTS);
    stream.by_time = true;
    for (uint64_t slot = 0; slot < (uint64_t)rounds * BT_SLOTS; slot++) {
        uint8_t command = bt_channel_command[bt_slot_channel[slot % BT_SLOTS]];
        uint64_t t_us = slot / BT_SLOTS * round_us + slot % BT_SLOTS * round_us / BT_SLOTS;
        uint16_t got =
            bt_emu_stream_in_order(&stream, 0, (uint8_t)((command & 0x7E) >> 1), 1000 * (t_us % UINT32_MAX));
        uint32_t place = stream.at % (8 * BT_SLOTS);
        assert_int_equal(got, count_at(place, 0));
        assert_int_equal(place % BT_SLOTS, slot % BT_SLOTS); // whole rounds are moved
    }
    assert_int_equal(stream.at / BT_SLOTS, (int32_t)(rounds - 1) + stream.moved);
    return stream.at / BT_SLOTS;
}

TEST(test_by_time_a_slow_bus_misses_rounds_and_a_quick_one_gets_some_twice)
{
    assert_int_equal(play_by_time(1001, 10000), 1000);
    assert_int_equal(stream.moved, 0);
    assert_int_equal(play_by_time(1001, 10010), 1001); // 1000 ppm of 10 s are one round
    assert_int_equal(play_by_time(1001, 9990), 999);
    assert_int_equal(play_by_time(101, 25000), 250);
}

TEST(test_a_live_round_that_is_late_or_not_whole_is_the_one_before_again_and_counted)
{
    static uint16_t roomy[4 * FINGERS * BT_SLOTS];
    bt_emu_stream_init(&stream, roomy, 4 * FINGERS * BT_SLOTS);
    stream.live = true;
    (void)put(0, BT_SLOTS);
    (void)put(BT_SLOTS, 10);
    for (uint32_t round = 0; round < 3; round++) {
        for (uint32_t slot = 0; slot < BT_SLOTS; slot++) {
            assert_int_equal(ask(0, slot), count_at(slot, 0));
        }
        assert_int_equal(stream.late, round);
    }
    (void)put(BT_SLOTS + 10, BT_SLOTS - 10);
    for (uint32_t slot = BT_SLOTS; slot < 2 * BT_SLOTS; slot++) {
        assert_int_equal(ask(0, slot), count_at(slot, 0));
    }
    assert_int_equal(stream.late, 2);
    assert_int_equal(stream.starved, 0);
}

static uint16_t at_time(uint8_t finger, uint32_t slot)
{
    uint8_t command = bt_channel_command[bt_slot_channel[slot % BT_SLOTS]];
    // As the sampler: in whole us, and a little late.
    uint64_t t_ns = 7000 + (slot * 1000000ull / BT_SLOT_HZ + 30) * 1000;
    return bt_emu_stream_by_clock(&stream, finger, (uint8_t)((command & 0x7E) >> 1), t_ns);
}

TEST(test_by_the_clock_every_sample_is_of_its_own_slot_and_a_missing_round_is_known_before_it_begins)
{
    uint32_t put_in = 0;
    assert_true(bt_emu_stream_lacks(&stream, 0));
    for (uint32_t slot = 0; slot < ROUNDS * BT_SLOTS; slot++) {
        put_in += put_in == slot ? put(put_in, BT_SLOTS) : 0;
        assert_int_equal(put_in, slot / BT_SLOTS * BT_SLOTS + BT_SLOTS);
        for (uint8_t f = 0; f < FINGERS; f++) {
            assert_int_equal(at_time(f, slot), count_at(slot, f));
        }
        uint64_t next_ns = stream.start_ns + (slot + 1) * 1000000000ull / BT_SLOT_HZ;
        assert_int_equal(bt_emu_stream_lacks(&stream, next_ns), put_in == slot + 1);
    }
    assert_int_equal(bt_emu_stream_lacks_at_ns(&stream), stream.start_ns + ROUNDS * BT_FRAME_MS * 1000000ull);
    assert_int_equal(bt_emu_stream_room(&stream), BT_SLOTS); // the round that is read stays
}

TEST(test_by_the_clock_a_board_that_was_reset_goes_on_with_the_round_that_comes_next)
{
    (void)put(0, BT_SLOTS);
    (void)put(BT_SLOTS, BT_SLOTS);
    stream.begins_at = stream.at = 2 * BT_SLOTS;
    assert_true(bt_emu_stream_lacks(&stream, 0));
    (void)put(2 * BT_SLOTS, BT_SLOTS);
    assert_false(bt_emu_stream_lacks(&stream, 0));
    assert_int_equal(at_time(1, 0), count_at(2 * BT_SLOTS, 1));
    assert_int_equal(at_time(1, 43), count_at(2 * BT_SLOTS + 43, 1));
}
