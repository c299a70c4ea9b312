// What a hold's watched baseline makes of a silence, at the edges of each of its conditions (SPEC.md, Tare).
#include "support.h"

#include "touch/watch.h"

#include <math.h>

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
    its = after_even(8, 11 * 8); // a load: nothing was followed
    its.watch.side = 5;
    (void)bt_watch_resume(&its.watch, &its.silence, SPAN_Q3);
    assert_int_equal(its.watch.side, 5);
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

// ---- after a sweep -----------------------------------------------------------------------------

static void what_is_watched_is_seen_once_five_sweeps_were_still(void **state)
{
    (void)state;
    bt_watch watch = {0};
    bt_sweep sweep = {.still_sweeps = 5};
    assert_true(bt_watch_sees(&watch, &sweep));
    sweep.still_sweeps = 4;
    assert_false(bt_watch_sees(&watch, &sweep));
    sweep.still_sweeps = 5;
    watch.wait_sweeps = 1;
    assert_false(bt_watch_sees(&watch, &sweep));
}

// Two counts of pressure, in either direction; 32 sweeps in which it did not move by more.
static void pressure_is_level_while_it_stays_within_two_counts(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        bt_watch watch = {.level_q3 = REST_Q3, .one_way_q2 = 7, .wait_sweeps = 0};
        const uint16_t near_q3 = (uint16_t)(REST_Q3 + sign * 16), far_q3 = (uint16_t)(REST_Q3 + sign * 17);
        for (int n = 1; n <= 300; n++) {
            bt_watch_end(&watch, &near_q3);
            assert_int_equal(watch.level_sweeps, n < 255 ? n : 255);
            assert_int_equal(bt_watch_level(&watch), n >= 32);
            assert_int_equal(watch.level_q3, REST_Q3);
            assert_int_equal(watch.wait_sweeps, 0);
        }
        bt_watch slow = watch;
        bt_watch_end(&slow, &far_q3); // skin creeps: goes on as level
        assert_true(slow.slow && bt_watch_level(&slow) && slow.wait_sweeps == 0);
        assert_int_equal(slow.level_q3, far_q3);
        assert_int_equal(slow.level_sweeps, 0);
        slow.level_sweeps = 32;
        bt_watch_end(&slow, &(const uint16_t){REST_Q3});
        assert_true(slow.slow);
        watch.level_sweeps = 31;
        watch.creeps = 100;
        bt_watch quick = watch;
        bt_watch_end(&quick, &far_q3); // a load: what was watched before says nothing
        assert_false(quick.slow || bt_watch_level(&quick));
        assert_int_equal(quick.wait_sweeps, 5);
        assert_int_equal(quick.creeps, 0);
        assert_int_equal(quick.one_way_q2, 0);
        assert_int_equal(quick.base.electrode_q16[0], BT_TARE_UNKNOWN);
        watch.level_sweeps = 255;
        bt_watch_end(&watch, NULL); // nor does pressure that is not known
        assert_false(watch.slow || bt_watch_level(&watch));
        assert_int_equal(watch.level_q3, 0);
        assert_int_equal(watch.wait_sweeps, 5);
    }
}

static void skin_creeps_for_twenty_seconds_after_the_load_changed(void **state)
{
    (void)state;
    bt_watch watch = {.one_way = true, .follows = true, .level_q3 = REST_Q3};
    bt_watch_begin(&watch);
    assert_false(watch.one_way || watch.follows);
    for (int n = 1; n <= 300; n++) {
        bt_watch_end(&watch, &(const uint16_t){REST_Q3});
        assert_int_equal(bt_watch_creeps(&watch), n < 250);
        assert_int_equal(bt_watch_crept(&watch), n == 250);
    }
    assert_int_equal(watch.creeps, 255);
}

static void one_way_is_a_low_pass_of_four_sweeps_either_way(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        bt_watch watch = {.level_q3 = REST_Q3};
        int one_way_q2 = 0;
        for (int n = 0; n < 40; n++) { // up to 19 * 4, and back
            const int side = n < 20 ? sign * (n % 3 ? 19 : 5) : 0;
            one_way_q2 += side - (int)floor(one_way_q2 / 4.0);
            watch.side = (int8_t)side;
            bt_watch_end(&watch, &(const uint16_t){REST_Q3});
            assert_int_equal(watch.one_way_q2, one_way_q2);
            assert_int_equal(watch.one_way, abs(one_way_q2) >= 26);
        }
        for (int side = 25; side <= 26; side++) {
            watch.one_way_q2 = 0;
            watch.side = (int8_t)(sign * side);
            bt_watch_end(&watch, &(const uint16_t){REST_Q3});
            assert_int_equal(watch.one_way, side == 26);
        }
        // A step of it is half a count a second at most.
        watch.one_way = true;
        watch.shared_q16 = sign * 2623;
        assert_int_equal(bt_watch_drifts_q16(&watch), sign * 2623);
        watch.shared_q16 = sign * 2625;
        assert_int_equal(bt_watch_drifts_q16(&watch), sign * 2624);
        watch.one_way = false;
        assert_int_equal(bt_watch_drifts_q16(&watch), 0);
    }
}

// Within the span what was watched holds, within twice of it what all share is still to be followed, beyond
// that it begins anew.
static void signals_that_come_back_are_watched_as_before(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        static const int away_q3[] = {96, 97, 192, 193};
        for (int k = 0; k < 4; k++) {
            bt_watch watch = {.wait_sweeps = 3};
            bt_sweep sweep = {0};
            for (int i = 0; i < BT_ELECTRODES; i++) {
                watch.base.electrode_q16[i] = 20000u << 13;
                sweep.mean_q3.lane[i] = (uint16_t)(20000 + sign * (i == 0 ? away_q3[k] : 38));
            }
            bt_watch_return(&watch, &sweep, 0, SPAN_Q3);
            assert_int_equal(watch.wait_sweeps, 0);
            const double shared_q3 = sign * (away_q3[k] + 18 * 38) / 19.0;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                const double want_q3 = k == 0   ? 20000
                                       : k == 3 ? sweep.mean_q3.lane[i]
                                                : sweep.mean_q3.lane[i] - shared_q3;
                // A 19th in q16 is cut.
                assert_true(fabs(watch.base.electrode_q16[i] / 8192.0 - want_q3) <= 0.002 * fabs(shared_q3));
            }
        }
    }
}

// Where each goes at its own pace: a quarter more where it lags, else a quarter less.
static void an_electrode_that_lags_is_followed_by_more(void **state)
{
    (void)state;
    static const struct {
        int32_t step, lags, leads;
    } cases[] = {{400, 500, 300}, {-400, -500, -300}, {0, 0, 0}};
    bt_watch watch = {.follows = true};
    const uint32_t base = 3000u << 16, more = base + 1, less = base - 1;
    for (int k = 0; k < 3; k++) {
        const int32_t step = cases[k].step;
        assert_int_equal(bt_watch_step_q16(&watch, step, step > 0 ? more : less, base), cases[k].lags);
        assert_int_equal(bt_watch_step_q16(&watch, step, step > 0 ? less : more, base), cases[k].leads);
        assert_int_equal(bt_watch_step_q16(&watch, step, base, base), cases[k].leads);
    }
    watch.follows = false;
    assert_int_equal(bt_watch_step_q16(&watch, 400, more, base), 400);
    bt_watch_side(&watch, 3000u << 16, 2999u << 16);
    assert_int_equal(watch.side, 1);
    assert_int_equal(watch.away_q3, 8);
    bt_watch_side(&watch, 2990u << 16, 3000u << 16);
    bt_watch_side(&watch, base, base);
    assert_int_equal(watch.side, 0);
    assert_int_equal(watch.away_q3, 8 - 80);
    bt_watch_side(&watch, base, BT_TARE_UNKNOWN);
    assert_int_equal(watch.away_q3, 8 - 80);
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
        cmocka_unit_test(what_is_watched_is_seen_once_five_sweeps_were_still),
        cmocka_unit_test(pressure_is_level_while_it_stays_within_two_counts),
        cmocka_unit_test(skin_creeps_for_twenty_seconds_after_the_load_changed),
        cmocka_unit_test(one_way_is_a_low_pass_of_four_sweeps_either_way),
        cmocka_unit_test(signals_that_come_back_are_watched_as_before),
        cmocka_unit_test(an_electrode_that_lags_is_followed_by_more),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
