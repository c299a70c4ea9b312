// What a hold's watched baseline makes of a silence, at the edges of each of its conditions (SPEC.md, Tare).
#include "support.h"

#include "touch/watch.h"

#define SPAN_Q3     96
#define REST_Q3     (8 * 1326) // of the pressure
#define SWEEPS      100        // of silence
#define COUNT_Q16   65536
#define MISSED_Q16  1312 // 15 counts a minute, in a sweep of 80 ms
#define LEVEL_SINCE 40

typedef struct {
    bt_watch watch;
    bt_silence silence;
} hold;

// Every electrode read 3000 counts after the silence, away_q3 more than where it was watched.
static hold after(const int16_t away_q3[BT_ELECTRODES], int pressure_q3)
{
    hold its = {.watch = {.level_q3 = REST_Q3, .level_sweeps = LEVEL_SINCE}, .silence = {.sweeps = SWEEPS}};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        its.watch.base.electrode_q16[i] = (uint32_t)(8 * 3000 - away_q3[i]) << 13;
        its.silence.sum.lane[i] = 3000 * BT_SILENCE_ROUNDS;
    }
    its.silence.sum.lane[BT_LANE_PDC] = (uint16_t)((REST_Q3 + pressure_q3) / 8 * BT_SILENCE_ROUNDS);
    return its;
}

static hold after_even(int16_t each_q3, int pressure_q3)
{
    int16_t away_q3[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        away_q3[i] = each_q3;
    }
    return after(away_q3, pressure_q3);
}

static int32_t resumed(hold its)
{
    return bt_watch_resume(&its.watch, &its.silence, SPAN_Q3);
}

static void what_all_electrodes_share_is_followed_by_its_mean(void **state)
{
    (void)state;
    // A 19th in q16 is cut.
    assert_in_range(resumed(after_even(8, 0)), COUNT_Q16 * 0.998, COUNT_Q16);
    assert_in_range(-resumed(after_even(-8, 0)), COUNT_Q16 * 0.998, COUNT_Q16);
    assert_int_equal(resumed(after_even(0, 0)), 0);
}

static void no_more_than_the_worst_drift_is_followed(void **state)
{
    (void)state;
    assert_int_equal(resumed(after_even(64, 0)), SWEEPS * MISSED_Q16);
    assert_int_equal(resumed(after_even(-64, 0)), -SWEEPS * MISSED_Q16);
    hold its = after_even(64, 0);
    its.watch.level_sweeps = 10; // 32 make it level: 22 of the silence are gone before
    assert_int_equal(resumed(its), (SWEEPS - 22) * MISSED_Q16);
    its.watch.slow = true;
    assert_int_equal(resumed(its), SWEEPS * MISSED_Q16);
    its = after_even(64, 0);
    its.watch.wait_sweeps = 1; // what was watched is not where it came to rest
    assert_int_equal(resumed(its), 0);
}

// Level is 2 counts in 32 sweeps, ten at most.
static void pressure_that_moved_further_than_skin_creeps_is_a_load(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        hold its = after_even(8, sign * 8 * 8); // (40 + 100) / 32 * 2 = 8.75 counts
        assert_true(bt_watch_resume(&its.watch, &its.silence, SPAN_Q3) != 0);
        assert_true(its.watch.slow);
        assert_int_equal(its.watch.level_q3, REST_Q3 + sign * 8 * 8);
        assert_int_equal(its.watch.level_sweeps, 0);
        assert_int_equal(resumed(after_even(8, sign * 9 * 8)), 0);
        its = after_even(8, sign * 2 * 8);
        assert_true(bt_watch_resume(&its.watch, &its.silence, SPAN_Q3) != 0);
        assert_false(its.watch.slow);
        assert_int_equal(its.watch.level_q3, REST_Q3);
        assert_int_equal(its.watch.level_sweeps, LEVEL_SINCE + SWEEPS);
        its = after_even(8, sign * 10 * 8);
        its.silence.sweeps = 10000;
        assert_true(resumed(its) != 0);
        its = after_even(8, sign * 11 * 8);
        its.silence.sweeps = 10000;
        assert_int_equal(resumed(its), 0);
    }
}

static void thirteen_must_have_gone_one_way_for_six_the_other(void **state)
{
    (void)state;
    for (int16_t sign = -1; sign <= 1; sign = (int16_t)(sign + 2)) {
        int16_t away_q3[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            away_q3[i] = (int16_t)(i < 13 ? 8 * sign : -sign);
        }
        assert_true(resumed(after(away_q3, 0)) != 0);
        away_q3[0] = 0;
        assert_int_equal(resumed(after(away_q3, 0)), 0);
    }
}

// One of 19 that is 101 from the others is 96 from the mean of all.
static void one_that_went_its_own_way_is_a_load(void **state)
{
    (void)state;
    for (int16_t sign = -1; sign <= 1; sign = (int16_t)(sign + 2)) {
        int16_t away_q3[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            away_q3[i] = 16;
        }
        away_q3[7] = (int16_t)(16 + sign * 101);
        assert_true(resumed(after(away_q3, 0)) != 0);
        away_q3[7] = (int16_t)(16 + sign * 103);
        assert_int_equal(resumed(after(away_q3, 0)), 0);
        hold its = after(away_q3, 0);
        its.watch.base.electrode_q16[7] = BT_TARE_UNKNOWN; // says nothing
        assert_true(resumed(its) != 0);
    }
}

static void the_sweep_under_way_counts_from_there(void **state)
{
    (void)state;
    hold its = after_even(8, 0);
    its.watch.side = 5;
    its.watch.away_q3 = 100;
    its.watch.shared_q16 = 1000;
    (void)bt_watch_resume(&its.watch, &its.silence, SPAN_Q3);
    assert_int_equal(its.watch.side, 0);
    assert_int_equal(its.watch.away_q3, 0);
    assert_int_equal(its.watch.shared_q16, 0);
}

static void what_is_watched_are_the_means_of_lanes_that_are_known(void **state)
{
    (void)state;
    bt_watch watch = {.wait_sweeps = 3};
    bt_sweep sweep = {0};
    for (unsigned lane = 0; lane < BT_LANES; lane++) {
        sweep.mean_q3.lane[lane] = (uint16_t)(20000 + 100 * lane);
    }
    for (unsigned gone = 0; gone < BT_LANES; gone++) {
        bt_watch_take(&watch, &sweep, 1u << gone);
        for (unsigned lane = 0; lane < BT_LANES; lane++) {
            uint32_t its = lane == BT_LANE_PDC ? watch.base.pdc_q16 : watch.base.electrode_q16[lane];
            assert_int_equal(its, lane == gone ? BT_TARE_UNKNOWN : (20000 + 100 * lane) << 13);
        }
    }
    assert_int_equal(watch.wait_sweeps, 0);
}

// Thirteen one way for six the other, through a low-pass: one sweep is not enough.
static void a_sweep_tells_what_its_electrodes_are_away_by(void **state)
{
    (void)state;
    bt_watch watch = {.side = 19, .away_q3 = 19 * 8};
    const uint16_t pressure_q3 = REST_Q3;
    bt_watch_end(&watch, &pressure_q3);
    assert_in_range(watch.shared_q16, COUNT_Q16 * 0.998, COUNT_Q16);
    assert_int_equal(watch.side, 0);
    assert_int_equal(watch.away_q3, 0);
    assert_int_equal(watch.one_way_q2, 19);
    assert_false(watch.one_way);
    watch.side = 11; // and three quarters of the 19, rounded up: 26
    bt_watch_end(&watch, &pressure_q3);
    assert_int_equal(watch.one_way_q2, 26);
    assert_true(watch.one_way);
    assert_int_equal(watch.shared_q16, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_all_electrodes_share_is_followed_by_its_mean),
        cmocka_unit_test(no_more_than_the_worst_drift_is_followed),
        cmocka_unit_test(pressure_that_moved_further_than_skin_creeps_is_a_load),
        cmocka_unit_test(thirteen_must_have_gone_one_way_for_six_the_other),
        cmocka_unit_test(one_that_went_its_own_way_is_a_load),
        cmocka_unit_test(the_sweep_under_way_counts_from_there),
        cmocka_unit_test(what_is_watched_are_the_means_of_lanes_that_are_known),
        cmocka_unit_test(a_sweep_tells_what_its_electrodes_are_away_by),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
