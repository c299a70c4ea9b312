// Static pressure and the force from it, against Navarro 2015 Eq 1 and 3 in double.
#include "support.h"

#include "signal/round.h"
#include "solve/pressure.h"

#include <math.h>

#define GAIN_NN 10000000 // 0.01 N per count

static bt_pressure with_filter(int32_t filter_milli)
{
    bt_settings settings;
    bt_pressure pressure;
    memset(&pressure, 0, sizeof pressure);
    bt_settings_reset(&settings);
    assert_int_equal(bt_settings_set(&settings, BT_SETTING_PRESSURE_FILTER_MILLI, filter_milli), BT_ERROR_OK);
    bt_pressure_use(&pressure, &settings);
    return pressure;
}

// Eq 3 in double over random words, steps over the whole range among them. Each step is rounded to 1/256
// count, and of an error alpha is forgotten with each word, so it stays below 1/512 / alpha; publishing adds
// 1/32.
TEST(the_filter_is_the_papers_within_its_rounding)
{
    static const int alphas[] = {10, 37, 100, 333, 500, 501, 750, 999, 1000};
    uint64_t seed = 2015;
    for (size_t a = 0; a < sizeof alphas / sizeof *alphas; a++) {
        bt_pressure pressure = with_filter(alphas[a]);
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

TEST(a_missing_or_railed_word_is_invalid_and_the_next_begins_anew)
{
    static const uint16_t bad[] = {BT_INVALID_COUNT, 0, BT_RAIL_COUNT, BT_FULL_SCALE_COUNT};
    for (int b = 0; b < 4; b++) {
        bt_pressure pressure = with_filter(500);
        bt_pressure_add(&pressure, 1326);
        bt_pressure_add(&pressure, bad[b]);
        assert_int_equal(bt_pressure_filtered_q4(&pressure), BT_INVALID_COUNT);
        bt_pressure_add(&pressure, 2000); // not half way from the value before
        assert_int_equal(bt_pressure_filtered_q4(&pressure), 16 * 2000);
    }
}

// Eq 1 in long double, rounded half away from zero: every corner, and halves that a product hits exactly.
static void assert_force(uint16_t filtered_q4, uint16_t tare_q4, int32_t gain_nn)
{
    long double exact = ((long double)filtered_q4 - tare_q4) * gain_nn / 16 / 100000;
    assert_int_equal(bt_pressure_force(filtered_q4, tare_q4, gain_nn), (int32_t)roundl(exact));
}

TEST(the_force_is_the_exact_product_rounded_once)
{
    static const uint16_t ends[] = {0, 1, 16, 21216, 21217, BT_E_MAX_Q4 - 1, BT_E_MAX_Q4};
    for (int f = 0; f < 7; f++) {
        for (int t = 0; t < 7; t++) {
            assert_force(ends[f], ends[t], 1);
            assert_force(ends[f], ends[t], 800000); // in steps of a half
            assert_force(ends[f], ends[t], BT_SETTING_PRESSURE_GAIN_NN_MAX);
        }
    }
    uint64_t seed = 6;
    for (int k = 0; k < 200000; k++) {
        assert_force((uint16_t)random_range(&seed, 0, BT_E_MAX_Q4),
                     (uint16_t)random_range(&seed, 0, BT_E_MAX_Q4),
                     (int32_t)random_range(&seed, 1, BT_SETTING_PRESSURE_GAIN_NN_MAX));
    }
}

TEST(without_pressure_or_rest_or_a_gain_there_is_no_force)
{
    assert_int_equal(bt_pressure_force(BT_INVALID_COUNT, 16, GAIN_NN), INT32_MIN);
    assert_int_equal(bt_pressure_force(16, BT_INVALID_COUNT, GAIN_NN), INT32_MIN);
    assert_int_equal(bt_pressure_force(16 * 1050, 16 * 1000, 0), INT32_MIN);
}

int main(void)
{
    return run_all(NULL, NULL);
}
