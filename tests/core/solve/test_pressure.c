// Static pressure and the force from it, against Navarro 2015 Eq 1 and 3 in double.
#include "support.h"

#include "finger.h"

#include <math.h>

#define ALPHA_MILLI 500
#define GAIN_NN     10000000 // 0.01 N per count

static bt_pressure with(int32_t gain_nn, int32_t filter_milli)
{
    bt_settings settings;
    bt_pressure pressure;
    memset(&pressure, 0, sizeof pressure);
    bt_settings_reset(&settings);
    assert_int_equal(bt_settings_set(&settings, BT_SETTING_PRESSURE_GAIN_NN, gain_nn), BT_ERROR_OK);
    assert_int_equal(bt_settings_set(&settings, BT_SETTING_PRESSURE_FILTER_MILLI, filter_milli), BT_ERROR_OK);
    bt_pressure_use(&pressure, &settings);
    return pressure;
}

// Eq 3 in double over random words, steps over the whole range among them. Each step is rounded to 1/256
// count, and of an error alpha is forgotten with each word, so it stays below 1/512 / alpha; publishing adds
// 1/32.
static void the_filter_is_the_papers_within_its_rounding(void **state)
{
    (void)state;
    static const int alphas[] = {10, 37, 100, 333, 500, 501, 750, 999, 1000};
    uint64_t seed = 2015;
    for (size_t a = 0; a < sizeof alphas / sizeof *alphas; a++) {
        bt_pressure pressure = with(GAIN_NN, alphas[a]);
        double alpha = alphas[a] / 1000.0, want = 0, bound = 1.0 / 32 + 1.0 / 512 / alpha;
        for (int k = 0; k < 20000; k++) {
            uint16_t word = (uint16_t)(k % 500 < 250 ? random_range(&seed, 1320, 1332)
                                                     : random_range(&seed, 1, BT_RAIL_COUNT - 1));
            bt_pressure_add(&pressure, word);
            want = k == 0 ? word : word * alpha + want * (1 - alpha);
            double got = bt_pressure_filtered_q4(&pressure) / 16.0;
            if (!(fabs(got - want) <= bound + 1e-9)) {
                fail_msg("alpha %d, word %d: %f, expected %f", alphas[a], k, got, want);
            }
        }
    }
}

static void the_default_filter_is_half_and_no_gain_is_calibrated(void **state)
{
    (void)state;
    bt_finger finger;
    bt_finger_reset(&finger, 0);
    assert_int_equal(finger.pressure.filter_milli, ALPHA_MILLI);
    assert_int_equal(finger.pressure.gain_nn, 0);
    bt_pressure pressure = with(0, ALPHA_MILLI);
    bt_pressure_add(&pressure, 1000);
    bt_pressure_add(&pressure, 1100);
    assert_int_equal(bt_pressure_filtered_q4(&pressure), 16 * 1050);
    assert_int_equal(bt_pressure_force(16 * 1050, 16 * 1000, 0), INT32_MIN);
}

static void a_held_pressure_is_reached_from_both_sides(void **state)
{
    (void)state;
    static const uint16_t ends[] = {1, 1326, BT_RAIL_COUNT - 1};
    for (int from = 0; from < 3; from++) {
        for (int to = 0; to < 3; to++) {
            bt_pressure pressure = with(GAIN_NN, ALPHA_MILLI);
            bt_pressure_add(&pressure, ends[from]);
            for (int k = 0; k < 30; k++) {
                bt_pressure_add(&pressure, ends[to]);
            }
            assert_int_equal(bt_pressure_filtered_q4(&pressure), 16 * ends[to]);
        }
    }
}

static void a_missing_or_railed_word_is_invalid_and_the_next_begins_anew(void **state)
{
    (void)state;
    static const uint16_t bad[] = {BT_INVALID_COUNT, 0, BT_RAIL_COUNT, BT_FULL_SCALE_COUNT};
    for (int b = 0; b < 4; b++) {
        bt_pressure pressure = with(GAIN_NN, ALPHA_MILLI);
        bt_pressure_add(&pressure, 1326);
        bt_pressure_add(&pressure, bad[b]);
        assert_int_equal(bt_pressure_filtered_q4(&pressure), BT_INVALID_COUNT);
        bt_pressure_add(&pressure, 2000); // not half way from what was before
        assert_int_equal(bt_pressure_filtered_q4(&pressure), 16 * 2000);
    }
}

// Eq 1 in long double, rounded half away from zero: every corner, and halves that a product hits exactly.
static void assert_force(uint16_t filtered_q4, uint16_t tare_q4, int32_t gain_nn)
{
    long double exact = ((long double)filtered_q4 - tare_q4) * gain_nn / 16 / 100000;
    assert_int_equal(bt_pressure_force(filtered_q4, tare_q4, gain_nn), (int32_t)roundl(exact));
}

static void the_force_is_the_exact_product_rounded_once(void **state)
{
    (void)state;
    static const uint16_t ends[] = {0, 1, 16, 21216, 21217, BT_E_MAX_Q4 - 1, BT_E_MAX_Q4};
    static const int32_t gains[] = {1, 7, 50000, 100000, 9000000, 16000000, BT_SETTING_PRESSURE_GAIN_NN_MAX};
    for (int f = 0; f < 7; f++) {
        for (int t = 0; t < 7; t++) {
            for (int g = 0; g < 7; g++) {
                assert_force(ends[f], ends[t], gains[g]);
            }
        }
    }
    assert_int_equal(bt_pressure_force(17, 16, 800000), 1); // half a step up
    assert_int_equal(bt_pressure_force(16, 17, 800000), -1);
    assert_int_equal(bt_pressure_force(BT_E_MAX_Q4, 0, 100000000), 4095000); // 409.5 N: nothing wraps
    assert_int_equal(bt_pressure_force(0, BT_E_MAX_Q4, 100000000), -4095000);
    uint64_t seed = 6;
    for (int k = 0; k < 200000; k++) {
        assert_force((uint16_t)random_range(&seed, 0, BT_E_MAX_Q4),
                     (uint16_t)random_range(&seed, 0, BT_E_MAX_Q4),
                     (int32_t)random_range(&seed, 1, BT_SETTING_PRESSURE_GAIN_NN_MAX));
    }
}

static void without_pressure_or_rest_there_is_no_force(void **state)
{
    (void)state;
    assert_int_equal(bt_pressure_force(BT_INVALID_COUNT, 16, GAIN_NN), INT32_MIN);
    assert_int_equal(bt_pressure_force(16, BT_INVALID_COUNT, GAIN_NN), INT32_MIN);
    assert_int_equal(bt_pressure_force(BT_INVALID_COUNT, BT_INVALID_COUNT, 0), INT32_MIN);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_filter_is_the_papers_within_its_rounding),
        cmocka_unit_test(the_default_filter_is_half_and_no_gain_is_calibrated),
        cmocka_unit_test(a_held_pressure_is_reached_from_both_sides),
        cmocka_unit_test(a_missing_or_railed_word_is_invalid_and_the_next_begins_anew),
        cmocka_unit_test(the_force_is_the_exact_product_rounded_once),
        cmocka_unit_test(without_pressure_or_rest_there_is_no_force),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
