// What a sweep at rest moves a tare by, the snapshots to go back to, and the pace of temperature: by hand.
#include "emulated_finger.h"

#define COUNT_Q16 65536

// At rest, at the begin of a sweep.
static emulated_finger at_rest(void)
{
    static emulated_finger finger; // the same each time
    if (finger.t_s == 0) {
        finger = resting_finger();
        while (finger.tare.sweep.round != 0) {
            step(&finger);
        }
        finger.tare.drift = (bt_drift){0};
        finger.tare.drift_q16 = 0;
    }
    return finger;
}

// Half a count a second, 328 in a frame, and never beyond where the electrode is.
static void an_electrode_is_followed_by_half_a_count_a_second(void **state)
{
    (void)state;
    static const int off_q16[] = {0, 1, 2623, 2624, 2625, 2 * COUNT_Q16};
    for (int k = 0; k < 6; k++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            emulated_finger finger = at_rest();
            const bt_baseline before = finger.tare.base;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                finger.tare.base.electrode_q16[i] += (uint32_t)(sign * off_q16[k]);
            }
            run_frames(&finger, BT_SWEEP_ROUNDS - 1); // the last serves no lane
            const int step_q16 = off_q16[k] < 2624 ? off_q16[k] : 2624;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                const int left = (int)(finger.tare.base.electrode_q16[i] - before.electrode_q16[i]);
                assert_int_equal(left, sign * (off_q16[k] - step_q16));
                assert_int_equal(finger.tare.electrode_q4[i], bt_tare_q4(finger.tare.base.electrode_q16[i]));
            }
        }
    }
}

// Down by a count a second, up by a fifth of one; after a press, for four seconds, by four.
static void pressure_is_followed_by_how_it_moves(void **state)
{
    (void)state;
    static const struct {
        int off_count, comes_back_q16;
        uint32_t age_rounds; // when it is served
        bool held;
        int step_q16;
    } cases[] = {
        {5, 0, 1000, false, 8 * 131},
        {-5, 0, 1000, false, -8 * 655},
        {5, 5 * COUNT_Q16, 399, false, 8 * 2621},
        {5, 5 * COUNT_Q16, 400, false, 8 * 131},
        {5, 1, 399, false, 8 * 2621},
        {5, 0, 399, false, 8 * 131},
        {-5, 5 * COUNT_Q16, 399, false, -8 * 655},
        {5, 0, 1000, true, 0},
        {0, 5 * COUNT_Q16, 399, false, 0},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        emulated_finger finger = at_rest();
        const uint32_t base_q16 = (uint32_t)(PDC_REST - cases[k].off_count) << 16;
        finger.tare.base.pdc_q16 = base_q16;
        finger.tare.comes_back_q16 = cases[k].comes_back_q16;
        finger.tare.age_rounds = cases[k].age_rounds - 7; // the pressure's lane is of the seventh round
        finger.tare.held = cases[k].held;
        run_frames(&finger, BT_SWEEP_ROUNDS - 1);
        assert_int_equal((int)(finger.tare.base.pdc_q16 - base_q16), cases[k].step_q16);
        const bool back = cases[k].step_q16 == 8 * 2621;
        assert_int_equal(finger.tare.comes_back_q16,
                         cases[k].comes_back_q16 - (back ? cases[k].step_q16 : 0));
    }
}

// A snapshot every three sweeps; five of them back, where there are so many.
static void a_touch_goes_back_to_what_was_a_second_ago(void **state)
{
    (void)state;
    bt_rollback rollback;
    bt_baseline base = {.pdc_q16 = 7000};
    memset(&rollback, 0xFF, sizeof rollback);
    bt_rollback_start(&rollback, &base);
    assert_int_equal(bt_rollback_before(&rollback)->pdc_q16, 7000);
    assert_int_equal(bt_rollback_sweeps(&rollback), 0);
    for (uint32_t sweep = 1; sweep <= 100; sweep++) {
        base.pdc_q16 = 7000 + sweep;
        bt_rollback_keep(&rollback, &base);
        const uint32_t latest = sweep / 3 * 3, oldest = latest > 15 ? latest - 15 : 0;
        assert_int_equal(bt_rollback_before(&rollback)->pdc_q16, 7000 + oldest);
        assert_int_equal(bt_rollback_sweeps(&rollback), sweep - oldest);
    }
    for (unsigned lane = 0; lane < BT_LANES; lane++) {
        bt_rollback_fill(&rollback, lane, 50 + lane);
    }
    for (int k = 0; k < BT_SNAPSHOTS; k++) {
        assert_int_equal(rollback.snapshot[k].pdc_q16, 50 + BT_LANE_PDC);
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            assert_int_equal(rollback.snapshot[k].electrode_q16[i], 50 + i);
        }
    }
}

static void a_baseline_stays_in_its_range(void **state)
{
    (void)state;
    const uint32_t full_q16 = 4095u << 16;
    assert_int_equal(bt_baseline_moved(10, -10), 0);
    assert_int_equal(bt_baseline_moved(10, -11), 0);
    assert_int_equal(bt_baseline_moved(full_q16 - 10, 10), full_q16);
    assert_int_equal(bt_baseline_moved(full_q16 - 10, 11), full_q16);
    assert_int_equal(bt_baseline_moved(BT_TARE_UNKNOWN, -11), BT_TARE_UNKNOWN);
    for (uint32_t q16 = 5u << 16; q16 < 6u << 16; q16 += 7) {
        assert_int_equal(bt_baseline_count(q16), q16 < (5u << 16) + 32768 ? 5 : 6);
        assert_int_equal(bt_tare_q4(q16), (uint32_t)floor(q16 / 4096.0 + 0.5));
    }
    assert_int_equal(bt_tare_q4(BT_TARE_UNKNOWN), BT_INVALID_COUNT);
}

// Two low-passes in cut steps, of 8 and of 128 sweeps behind that; a first word is both.
static void the_pace_of_temperature_is_how_far_the_slow_low_pass_is_behind(void **state)
{
    (void)state;
    bt_thermal thermal = {0};
    static const uint16_t none[] = {0, 4090, 4095, BT_INVALID_COUNT};
    for (int k = 0; k < 4; k++) {
        bt_thermal_add(&thermal, none[k], true);
        assert_int_equal(thermal.tdc_q8, 0);
    }
    bt_thermal_add(&thermal, 1000, false);
    assert_true(thermal.tdc_q8 == 1000 << 8 && thermal.tdc_then_q8 == 1000 << 8
                && thermal.slow_q14 == 1000 << 14);
    double quick_q8 = 1000 * 256, slow_q14 = 1000 * 16384;
    for (int sweep = 0; sweep < 600; sweep++) {
        const uint16_t tdc = (uint16_t)(1000 + (sweep < 300 ? sweep : 600 - sweep));
        bt_thermal_add(&thermal, (uint16_t)(tdc + 50), false); // within a sweep: not taken in
        bt_thermal_add(&thermal, tdc, true);
        quick_q8 += floor((tdc * 256 - quick_q8) / 8);
        slow_q14 += floor((quick_q8 * 64 - slow_q14) / 128);
        assert_int_equal(thermal.tdc_q8, (int)quick_q8);
        assert_int_equal(thermal.slow_q14, (int)slow_q14);
        for (int gain_q16 = -100000; gain_q16 <= 100000; gain_q16 += 50000) {
            const double rate_q16 = (quick_q8 * 64 - slow_q14) * gain_q16 / 2097152;
            assert_int_equal(bt_thermal_rate_q16(&thermal, gain_q16), (int)trunc(rate_q16));
        }
    }
    // 500 counts at most, either way; a step is what is not applied yet.
    for (int sign = -1; sign <= 1; sign += 2) {
        static const int warm[][2] = {{100, 100}, {499, 499}, {500, 500}, {501, 500}, {3000, 500}};
        int applied = 0;
        bt_thermal_begin(&thermal);
        for (int k = 0; k < 5; k++) {
            thermal.tdc_q8 = thermal.tdc_then_q8 + ((uint32_t)warm[k][0] << 8);
            bt_thermal_follow(&thermal, sign * COUNT_Q16);
            assert_int_equal(thermal.applied_q16, sign * warm[k][1] * COUNT_Q16);
            assert_int_equal(thermal.step_q16, sign * (warm[k][1] - applied) * COUNT_Q16);
            applied = warm[k][1];
        }
    }
    for (int q8 = 33 * 256 - 1; q8 <= 33 * 256 + 1; q8++) { // a degree
        for (int sign = -1; sign <= 1; sign += 2) {
            thermal.tdc_q8 = (uint32_t)(200000 + sign * q8);
            thermal.tdc_then_q8 = 200000;
            assert_int_equal(bt_thermal_warmed(&thermal), q8 > 33 * 256);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_electrode_is_followed_by_half_a_count_a_second),
        cmocka_unit_test(pressure_is_followed_by_how_it_moves),
        cmocka_unit_test(a_touch_goes_back_to_what_was_a_second_ago),
        cmocka_unit_test(a_baseline_stays_in_its_range),
        cmocka_unit_test(the_pace_of_temperature_is_how_far_the_slow_low_pass_is_behind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
