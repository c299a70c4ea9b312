// What a FRAME does without when it is late, at the edges of what is late: a clock that stands where the test
// puts it.
#include "map_board.h"

#define ON_TIME 10000 // a round that began at 0 has just ended
#define ALL     0x77  // quantities

static uint32_t late_us[BT_MAX_FINGERS];
static int asked; // of the clock, once for each FRAME

static uint32_t clock_us(void *context)
{
    (void)context;
    return ON_TIME + late_us[asked++ % BT_MAX_FINGERS];
}

static const uint8_t fingers = 1 << 1 | 1 << 3;

// A round; the k-th FRAME of it is late_us[k] late.
static void round_of(uint16_t count)
{
    host_forget();
    asked = 0;
    host_round(&session, fingers, count);
}

// The only FRAME of finger 1 in it.
static bt_msg_frame frame_of(uint16_t count)
{
    bt_msg_frame frame = {.finger = 0xFF};
    round_of(count);
    for (int k = 0; k < host.count; k++) {
        if (host.message[k].id == BT_FRAME_ID && host.message[k].payload[6] == 1) {
            assert_int_equal(frame.finger, 0xFF);
            bt_msg_frame_unpack(&frame, host.message[k].payload);
        }
    }
    assert_int_equal(frame.finger, 1);
    return frame;
}

static void all_late(uint32_t us)
{
    for (int k = 0; k < BT_MAX_FINGERS; k++) {
        late_us[k] = us;
    }
}

static int new_stream(void **state)
{
    (void)new_board(state);
    assert_int_equal(upload(1, blob, make_map(blob, 1, 5, "")), BT_ERROR_OK);
    assert_int_equal(upload(3, other, make_map(other, 2, 5, "")), BT_ERROR_OK);
    session.board.now_us = clock_us;
    all_late(0);
    assert_int_equal(subscribe(0x1F, ALL), BT_ERROR_OK);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, fingers, 0), BT_ERROR_OK);
    return 0;
}

static void tare(void)
{
    for (int k = 0; k < 60; k++) {
        round_of(2000);
    }
    assert_true(session.finger[1].tare.tared);
}

// Later than 11 ms a map's last wrench stands for the next, for a tenth of a second.
TEST(first_a_map_is_not_computed_but_its_wrench_repeated)
{
    all_late(11001);
    assert_false(frame_of(2000).flags & BT_FRAME_FLAG_REPEATED); // nothing is tared yet
    all_late(0);
    tare();
    bt_msg_frame fresh = frame_of(1990);
    assert_true(fresh.flags & BT_FRAME_FLAG_MAPPED && fresh.force_100un[2] != 0 && fresh.torque_mnmm[1] != 0);
    all_late(11000);
    fresh = frame_of(1991);
    assert_false(fresh.flags & BT_FRAME_FLAG_REPEATED);
    assert_int_equal(session.scheduler.sheds.wrench, 0);
    all_late(11001);
    for (int age = 1; age <= 10; age++) {
        bt_msg_frame frame = frame_of((uint16_t)(1989 + age % 2));
        assert_true(frame.flags & BT_FRAME_FLAG_REPEATED);
        assert_false(frame.flags & BT_FRAME_FLAG_NOT_ASKED);
        assert_int_equal(frame.wrench_age_ms, 10 * age);
        assert_memory_equal(frame.force_100un, fresh.force_100un, sizeof fresh.force_100un);
        assert_memory_equal(frame.torque_mnmm, fresh.torque_mnmm, sizeof fresh.torque_mnmm);
        assert_int_equal(frame.torsion_mnmm, fresh.torsion_mnmm);
        assert_true(frame.normal_mn == fresh.normal_mn && frame.shear_half_mn == fresh.shear_half_mn);
        assert_int_not_equal(frame.poc_um[0], BT_INVALID_I16);
        assert_int_equal(session.scheduler.sheds.wrench, 2 * age);
    }
    bt_msg_frame again = frame_of(1988);
    assert_false(again.flags & BT_FRAME_FLAG_REPEATED);
    assert_int_equal(again.wrench_age_ms, 0);
    assert_int_not_equal(again.force_100un[2], fresh.force_100un[2]);
    // Who did not ask for it has none.
    assert_int_equal(subscribe(0x1F, ALL & ~BT_QUANTITY_FLAG_FORCE), BT_ERROR_OK);
    bt_msg_frame less = frame_of(1988);
    assert_true(less.flags & BT_FRAME_FLAG_REPEATED && less.flags & BT_FRAME_FLAG_NOT_ASKED);
    assert_int_equal(less.force_100un[2], BT_INVALID_I32);
    assert_memory_equal(less.torque_mnmm, again.torque_mnmm, sizeof again.torque_mnmm);
    assert_int_equal(subscribe(0x1F, ALL & ~BT_QUANTITY_FLAG_TORQUE), BT_ERROR_OK);
    less = frame_of(1988);
    assert_true(less.flags & BT_FRAME_FLAG_REPEATED && less.flags & BT_FRAME_FLAG_NOT_ASKED);
    assert_int_equal(less.torque_mnmm[1], BT_INVALID_I32);
    assert_memory_equal(less.force_100un, again.force_100un, sizeof again.force_100un);
    // One without a tare has none to repeat.
    session.finger[1].tare.tared = false; // as inverted signals do
    session.finger[1].tare.reason = BT_TARE_REASON_INVERTED;
    all_late(0);
    assert_true(frame_of(1988).flags & BT_FRAME_FLAG_UNTARED);
    all_late(11001);
    assert_false(frame_of(1988).flags & BT_FRAME_FLAG_REPEATED);
}

// Later than 22 ms there is no FRAME; the next one says so, once.
TEST(whole_frames_go_last)
{
    tare();
    all_late(22000);
    (void)frame_of(1990);
    assert_int_equal(session.scheduler.sheds.frames, 0);
    all_late(22001);
    round_of(1990);
    assert_int_equal(host_count(BT_FRAME_ID), 0);
    assert_int_equal(session.scheduler.sheds.frames, 2);
    all_late(0);
    assert_true(frame_of(1990).flags & BT_FRAME_FLAG_SHED);
    assert_false(frame_of(1990).flags & BT_FRAME_FLAG_SHED);
    all_late(UINT32_MAX - ON_TIME); // a round that is still to end is not late
    (void)frame_of(1990);
    assert_int_equal(session.scheduler.sheds.frames, 2);
}

TEST(who_went_without_comes_first_in_the_next_round)
{
    tare();
    late_us[1] = 22001; // finger 3
    round_of(1990);
    assert_int_equal(session.scheduler.first, 3);
    late_us[1] = 0;
    round_of(1990);
    assert_int_equal(host_count(BT_FRAME_ID), 2);
    assert_int_equal(host.message[0].payload[6], 3);
    assert_int_equal(host.message[1].payload[6], 1);
    assert_int_equal(session.scheduler.first, 0);
    late_us[0] = 11001; // finger 1, whose map is not computed
    late_us[1] = 22001; // one comes first, and the first of them
    round_of(1990);
    assert_int_equal(session.scheduler.first, 1);
}

// One that never said who it is cannot be told from the next one: a quarter of a second of silence ends it.
TEST(who_is_not_known_is_forgotten_when_it_is_unplugged)
{
    tare();
    plug(3, SENSOR);
    for (int k = 1; k < BT_UNPLUGGED_ROUNDS; k++) {
        host_round(&session, 0, 2000);
    }
    assert_true(session.finger[1].tare.tared && session.finger[1].answered);
    host_round(&session, 0, 2000);
    assert_false(session.finger[1].tare.tared || session.finger[1].answered);
    assert_true(session.finger[3].tare.tared && session.finger[3].answered);
}

int main(void)
{
    return run_all(NULL, new_stream);
}
