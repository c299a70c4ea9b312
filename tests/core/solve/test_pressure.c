// Static pressure and the force from it, against Navarro 2015 Eq 1 and 3 in double.
#include "support.h"

#include "map/lesson.h"
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

// ---- the witness -----------------------------------------------------------------------------------------

#define REST 1300
static const bt_map without = {.lesson = NULL};

// A FRAME with half widths of 100 and 200 mN.
static bt_msg_frame felt(bt_pressure_learned *learned, uint16_t normal_mn, int counts, uint32_t flags)
{
    bt_msg_frame msg = {.normal_mn = normal_mn, .normal_half_mn = 100, .shear_half_mn = 200, .flags = flags};
    msg.pdc = (uint16_t)(REST + counts);
    msg.pdc_tare_q4 = 16 * REST;
    bt_pressure_witness(learned, &without, &msg);
    return msg;
}

// Half a second of 1 N and 100 counts.
static bt_pressure_learned taught(uint32_t flags)
{
    bt_pressure_learned learned = {0, 0};
    for (int k = 0; k < 50; k++) {
        bt_msg_frame msg = felt(&learned, 1000, 100, flags);
        assert_true(msg.normal_half_mn == 100 && msg.shear_half_mn == 200);
    }
    return learned;
}

TEST(an_interval_reaches_what_pressure_allows_where_it_parts_from_the_force)
{
    static const struct {
        uint16_t normal_mn;
        int counts, wider_mn; // within 40 mN
    } cases[] = {
        {4000, 400, 0},    {4000, 450, 0},      {4000, 360, 0},   {300, 40, 0},      {4000, 500, 1200},
        {4000, 560, 2000}, {4000, 1200, 10000}, {4000, 340, 225}, {4000, -20, 5000},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        bt_pressure_learned learned = taught(BT_FRAME_FLAG_TARE_UNSURE | BT_FRAME_FLAG_CONTACT);
        bt_msg_frame msg = felt(&learned, cases[k].normal_mn, cases[k].counts, 0);
        const int wider_mn = msg.normal_half_mn - 100;
        assert_true(cases[k].wider_mn == 0 ? wider_mn == 0 : abs(wider_mn - cases[k].wider_mn) <= 40);
        assert_int_equal(msg.shear_half_mn, 200 + wider_mn / 2);
    }
}

TEST(a_lesson_with_pressure_is_a_witness_from_the_first_frame_on)
{
    uint8_t lesson[BT_LESSON_BYTES] = {[BT_LESSON_PRESSURE_AT] = 100};
    const bt_map map = {.lesson = lesson};
    bt_pressure_learned learned = {0, 0};
    bt_msg_frame msg = {.normal_mn = 2000, .pdc = REST + 400, .pdc_tare_q4 = 16 * REST};
    bt_pressure_witness(&learned, &map, &msg);
    assert_in_range(msg.normal_half_mn, 2400, 2500); // it may be 4 N, and a quarter of the distance more
    lesson[BT_LESSON_PRESSURE_AT] = 20;
    bt_pressure_witness(&learned, &map, &msg); // what was learned counts
    assert_in_range(msg.normal_half_mn, 4800, 5000);
}

TEST(touches_unlike_the_lesson_or_too_light_teach_nothing)
{
    static const uint32_t flags[] = {BT_FRAME_FLAG_POPULATION, BT_FRAME_FLAG_OUTSIDE, BT_FRAME_FLAG_PDC_FLAT,
                                     BT_FRAME_FLAG_DOUBT};
    for (int k = 0; k < 4; k++) {
        bt_pressure_learned learned = taught(flags[k]);
        assert_int_equal(learned.felt, 0);
    }
    bt_pressure_learned learned = {0, 0};
    (void)felt(&learned, 600, 60, 0);
    (void)felt(&learned, 20000, 30, 0); // pressure that stays level
    (void)felt(&learned, BT_INVALID_COUNT, 100, 0);
    (void)felt(&learned, 1000, BT_INVALID_COUNT - REST, 0);
    assert_int_equal(learned.felt, 0);
}

TEST(a_narrow_tip_held_for_long_hardly_changes_what_is_learned)
{
    bt_pressure_learned learned = taught(0);
    for (int k = 0; k < 1000; k++) {
        assert_true(felt(&learned, 2000, 400, 0).normal_half_mn > 500 + 100);
    }
    learned = taught(0);
    for (int k = 0; k < 60000; k++) { // as a finger whose pressure is a half more now
        (void)felt(&learned, 4000, 600, 0);
    }
    assert_int_equal(felt(&learned, 4000, 600, 0).normal_half_mn, 100);
}

TEST(no_force_and_no_pressure_overflows)
{
    uint64_t seed = 70;
    bt_pressure_learned learned = {0, 0};
    for (int k = 0; k < 200000; k++) {
        bt_msg_frame msg = {.normal_mn = (uint16_t)random_range(&seed, 0, UINT16_MAX),
                            .normal_half_mn = (uint16_t)random_range(&seed, 0, UINT16_MAX),
                            .pdc = (uint16_t)random_range(&seed, 0, BT_FULL_SCALE_COUNT),
                            .pdc_tare_q4 = (uint16_t)random_range(&seed, 0, k % 2 ? 1600 : UINT16_MAX)};
        const uint16_t before = msg.normal_half_mn;
        bt_pressure_witness(&learned, &without, &msg);
        assert_true(msg.normal_half_mn >= before);
        assert_true((msg.normal_half_mn == BT_INVALID_COUNT) == (before == BT_INVALID_COUNT));
    }
}
