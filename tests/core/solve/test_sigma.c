// The standard deviations that a FRAME gives, against noise itself: a Monte Carlo through the papers'
// formulas in double, and the noise estimate they rest on against what was put in.
//
// An estimate of a standard deviation from N samples is off by 1 / sqrt(2 N) of it, one sigma. All
// intervals are five of those, so that a right program fails one seed in a million.
#include "emulated_finger.h"

#include "lin2013.h"
#include "solve/results.h"
#include "solve/uncertainty.h"

#define SAMPLES 20000
#define WITHIN  (5 / sqrt(2.0 * SAMPLES))

static bt_settings all_settings;

static bt_solve_settings kernel_settings(int weights)
{
    bt_settings_reset(&all_settings);
    (void)bt_settings_set(&all_settings, BT_SETTING_FORCE_MODEL, BT_FORCE_MODEL_LIN); // whose sigma is noise
    assert_int_equal(bt_settings_set(&all_settings, BT_SETTING_POC_WEIGHTS, weights), BT_ERROR_OK);
    return bt_solve_settings_from(&all_settings);
}

static lin2013_settings double_settings(int weights)
{
    lin2013_settings settings = {.poc_weights = weights};
    for (int d = 0; d < 3; d++) {
        settings.force_gain[d] =
            bt_settings_get(&all_settings, (uint8_t)(BT_SETTING_FORCE_GAIN_X_NN + d)) / 1e9;
    }
    return settings;
}

// A press whose middle lies at one electrode, with bulge far from it. Every electrode is far from zero,
// where a weight has a kink and nothing is first order.
#define E_LEAST 400
static void press(int middle, double e[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double square = 0;
        for (int d = 0; d < 3; d++) {
            double away = (bt_electrode_um[i][d] - bt_electrode_um[middle][d]) / 1000.0;
            square += away * away;
        }
        double value = -3000 * exp(-square / 50) + 600;
        e[i] = round(fabs(value) < E_LEAST ? copysign(E_LEAST, value) : value);
    }
}

static bt_msg_frame sigmas(const double e[BT_ELECTRODES], int weights, uint32_t noise_count2)
{
    bt_solve_settings settings = kernel_settings(weights);
    int32_t e_q4[BT_ELECTRODES];
    bt_msg_frame msg;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = (int32_t)lround(16 * e[i]);
    }
    (void)bt_solve(e_q4, &settings, BT_WANT_ALL, msg.poc_um, msg.force_100un, msg.torque_mnmm);
    bt_sigma_unknown(&msg);
    bt_sigma(e_q4, &settings, noise_count2, &msg);
    return msg;
}

// Standard deviations by brute force: of the PoC, all three axes together, in um; of the force in 100 uN.
typedef struct {
    double poc_um;
    double force_100un[3];
} spread;

static spread monte_carlo(const double e[BT_ELECTRODES], int weights, double sigma, uint64_t seed)
{
    lin2013_settings settings = double_settings(weights);
    lin2013_result middle, result;
    double sum[6] = {0}, squares[6] = {0}, variance[6];
    lin2013(e, &settings, &middle);
    for (int k = 0; k < SAMPLES; k++) {
        double noisy[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            noisy[i] = e[i] + sigma * gauss(&seed);
        }
        lin2013(noisy, &settings, &result);
        for (int d = 0; d < 6; d++) {
            double off = d < 3 ? 1000 * (result.poc_mm[d] - middle.poc_mm[d])
                               : 1e4 * (result.force_n[d - 3] - middle.force_n[d - 3]);
            sum[d] += off;
            squares[d] += off * off;
        }
    }
    for (int d = 0; d < 6; d++) {
        variance[d] = squares[d] / SAMPLES - sum[d] / SAMPLES * (sum[d] / SAMPLES);
    }
    return (spread){sqrt(variance[0] + variance[1] + variance[2]),
                    {sqrt(variance[3]), sqrt(variance[4]), sqrt(variance[5])}};
}

TEST(sigmas_are_those_of_a_monte_carlo)
{
    static const int noises[] = {2, 6, 16};
    for (int middle = 0; middle < BT_ELECTRODES; middle++) {
        for (int weights = 0; weights < 3; weights++) {
            double e[BT_ELECTRODES];
            int sigma = noises[(weights + middle) % 3];
            press(middle, e);
            bt_msg_frame msg = sigmas(e, weights, (uint32_t)(19 * sigma * sigma));
            spread want = monte_carlo(e, weights, sigma, 71 + (uint64_t)middle);
            // First order leaves out terms of (sigma / e)^2: of a squared weight, of its slope, of W.
            double off = WITHIN + 3.0 * sigma * sigma / (E_LEAST * E_LEAST);
            if (fabs(msg.poc_sigma_um - want.poc_um) > off * want.poc_um + 0.5) {
                fail_msg("PoC at E%d, noise %d: %d um, by brute force %.1f", middle + 1, sigma,
                         msg.poc_sigma_um, want.poc_um);
            }
            for (int d = 0; d < 3; d++) { // linear: nothing is left out but digits
                double force = want.force_100un[d];
                if (fabs(msg.force_sigma_100un[d] - force) > (WITHIN + 0.001) * force + 0.5) {
                    fail_msg("force %c, noise %d: %d, by brute force %.1f", 'x' + d, sigma,
                             msg.force_sigma_100un[d], force);
                }
            }
        }
    }
}

// The header's formula in double, of the published point and of what e is rounded to.
static double first_order_um(const double e[BT_ELECTRODES], int weights, const int16_t poc_um[3],
                             double sigma)
{
    const bool tip = poc_um[0] > 0;
    double along = 0, across = 0, total = 0, lever = 0, n[3];
    for (int d = 0; d < 3; d++) {
        n[d] = d == 0 && !tip ? 0 : (double)poc_um[d] / BT_CORE_RADIUS_UM;
    }
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (e[i] == 0 || (e[i] > 0 && weights != BT_POC_WEIGHTS_ABS_N2)) {
            continue;
        }
        const bool once = weights == BT_POC_WEIGHTS_COMPRESS_N1;
        const double size = fabs(e[i]), weight = once ? size : size * size, slope = once ? 1 : 2 * size;
        const int16_t *r = bt_electrode_um[i];
        const double x = tip ? r[0] : 0;
        const double cross[3] = {r[1] * n[2] - r[2] * n[1], r[2] * n[0] - x * n[2], x * n[1] - r[1] * n[0]};
        for (int d = 0; d < 3; d++) {
            across += slope * slope * cross[d] * cross[d];
        }
        along += tip ? 0 : slope * slope * pow(r[0] - poc_um[0], 2);
        total += weight;
        lever += weight * (x * n[0] + r[1] * n[1] + r[2] * n[2]);
    }
    return sigma * sqrt(along / (total * total) + across * pow(BT_CORE_RADIUS_UM / lever, 2));
}

TEST(sigmas_are_their_formula_from_a_whisper_to_the_end_of_the_range)
{
    static const int counts[] = {30, 300, 3000, 8000};
    uint64_t seed = 5;
    double off[3] = {0};
    int counted[3] = {0};
    for (int run = 0; run < 8000; run++) {
        const int most = counts[run % 4], weights = run / 4 % 3, middle = run / 12 % BT_ELECTRODES;
        const uint32_t noise = 19 * (uint32_t)random_range(&seed, 1, 36);
        double e[BT_ELECTRODES];
        press(middle, e);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = round(e[i] * most / 3000 + (double)random_range(&seed, -most / 20, most / 20));
        }
        bt_msg_frame msg = sigmas(e, weights, noise);
        const double want = first_order_um(e, weights, msg.poc_um, sqrt(noise / 19.0));
        // What a sum of rounded parts may be off: a hundredth, as it was with sums of 64 bits.
        if (fabs(msg.poc_sigma_um - want) > 0.5 + want / 100) {
            fail_msg("%d counts at E%d, weights %d: %d um, by the formula %.2f", most, middle + 1, weights,
                     msg.poc_sigma_um, want);
        }
        // What is rounded is not cut: where a um is little, only the steps' own cuts are left in the mean.
        if (want > 50) {
            const double exact = first_order_um(e, weights, msg.poc_um, bt_sigma_count_q8(noise) / 256.0);
            off[weights] += (msg.poc_sigma_um - exact) / exact;
            counted[weights]++;
        }
    }
    for (int weights = 0; weights < 3; weights++) {
        print_message("weights %d: off by %.2e in the mean of %d\n", weights, off[weights] / counted[weights],
                      counted[weights]);
        assert_true(fabs(off[weights] / counted[weights]) < 8.0 / 32768); // of eight steps
    }
}

// Whatever its noise, the point stays where the electrode is.
TEST(a_point_of_one_electrode_is_where_it_is)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int weights = 0; weights < 3; weights++) {
            double e[BT_ELECTRODES] = {0};
            e[i] = -700;
            assert_int_equal(sigmas(e, weights, 19 * 25).poc_sigma_um, 0);
        }
    }
}

TEST(one_electrodes_sigma_is_the_root_of_its_share)
{
    for (uint64_t noise = 1; noise < UINT32_MAX; noise += 1 + noise / 97) {
        uint64_t got = bt_sigma_count_q8((uint32_t)noise);
        uint64_t square = noise * (65536 / 19); // the share is cut to 1/65536 and the root to a whole number
        assert_true(got * got <= square && square < (got + 1) * (got + 1));
    }
    // Right below a square and right above it, where a quotient that is one too high would show.
    for (uint64_t root = 2; root * root / 3449 <= UINT32_MAX; root += 1 + root / 4099) {
        const uint64_t below = (root * root - 1) / 3449;
        for (uint64_t noise = below; noise <= below + 1 && noise <= UINT32_MAX; noise++) {
            uint64_t got = bt_sigma_count_q8((uint32_t)noise);
            assert_true(got * got <= noise * 3449 && noise * 3449 < (got + 1) * (got + 1));
        }
    }
}

// ---- the ends --------------------------------------------------------------------------------------

TEST(what_is_not_known_is_marked)
{
    double e[BT_ELECTRODES];
    press(9, e);
    bt_msg_frame msg = sigmas(e, BT_POC_WEIGHTS_ABS_N2, 0); // noise not measured yet
    assert_int_equal(msg.poc_sigma_um, 0xFFFF);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(msg.force_sigma_100un[d], 0xFFFF);
    }
    // Nothing weighs: there is no point, but there is a force.
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = fabs(e[i]);
    }
    msg = sigmas(e, BT_POC_WEIGHTS_COMPRESS_N1, 100);
    assert_int_equal(msg.poc_sigma_um, 0xFFFF);
    assert_true(msg.force_sigma_100un[2] != 0xFFFF);
    // A point that rests on less than half a count.
    memset(e, 0, sizeof e);
    e[3] = -7 / 16.0;
    msg = sigmas(e, BT_POC_WEIGHTS_COMPRESS_N1, 100);
    assert_true(msg.poc_um[0] != BT_INVALID_I16);
    assert_int_equal(msg.poc_sigma_um, 0xFFFF);
    // One that so little outweighs what makes half a count: it lies on the other side of the finger.
    e[3] = -8 / 16.0;
    for (int i = 10; i < 16; i++) {
        e[i] = -7 / 16.0;
    }
    msg = sigmas(e, BT_POC_WEIGHTS_COMPRESS_N1, 100);
    assert_true(msg.poc_um[1] > 3500);
    assert_int_equal(msg.poc_sigma_um, 0xFFFF);
}

TEST(sigmas_saturate_below_the_mark)
{
    double e[BT_ELECTRODES] = {0};
    e[1] = -1;
    e[15] = -1;
    for (int weights = 0; weights < 3; weights++) {
        bt_msg_frame msg = sigmas(e, weights, BT_SETTING_CONTACT_ENERGY_COUNT2_MAX);
        assert_int_equal(msg.poc_sigma_um, 65534); // millimetres a count, and 229 counts
        msg = sigmas(e, weights, UINT32_MAX);
        assert_int_equal(msg.poc_sigma_um, 65534);
    }
    (void)kernel_settings(0);
    assert_int_equal(bt_settings_set(&all_settings, BT_SETTING_FORCE_GAIN_X_NN, -100000000), BT_ERROR_OK);
    bt_solve_settings settings = bt_solve_settings_from(&all_settings);
    int32_t e_q4[BT_ELECTRODES] = {0};
    bt_msg_frame msg = {.poc_um = {BT_INVALID_I16}};
    bt_sigma_unknown(&msg);
    bt_sigma(e_q4, &settings, BT_SETTING_CONTACT_ENERGY_COUNT2_MAX, &msg);
    assert_int_equal(msg.force_sigma_100un[0], 65534); // 0.1 N a count
    assert_true(msg.force_sigma_100un[1] < 65534);
}

// It comes from other fingers, and is there before.
TEST(noise_leaves_the_sigma_of_the_population_alone)
{
    bt_solve_settings settings = kernel_settings(BT_POC_WEIGHTS_ABS_N2);
    int32_t e_q4[BT_ELECTRODES] = {[16] = -16 * 500};
    bt_msg_frame msg = {.poc_um = {BT_INVALID_I16}, .force_sigma_100un = {700, 700, 700}};
    settings.population = true;
    bt_sigma(e_q4, &settings, 400, &msg);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(msg.force_sigma_100un[d], 700);
    }
}

TEST(only_what_is_asked_for_has_a_sigma)
{
    bt_solve_settings settings = kernel_settings(BT_POC_WEIGHTS_ABS_N2);
    emulated_finger finger;
    finger_init(&finger);
    finger.sigma = 2;
    run_seconds(&finger, 5);
    finger.load = 400;
    (void)run_until(&finger, BT_TARE_STATE_CONTACT, 10);
    bt_round frame = next_frame(&finger);
    (void)feed(&finger, &frame);
    for (uint32_t quantities = 0; quantities < 64; quantities++) {
        bt_msg_frame msg;
        bt_results(&frame, &finger.tare, &settings, quantities, &msg);
        bool sigma = quantities & BT_QUANTITY_FLAG_SIGMA;
        assert_int_equal(msg.poc_sigma_um != 0xFFFF, sigma && quantities & BT_QUANTITY_FLAG_POC);
        for (int d = 0; d < 3; d++) {
            assert_int_equal(msg.force_sigma_100un[d] != 0xFFFF,
                             sigma && quantities & BT_QUANTITY_FLAG_FORCE);
        }
    }
}

// ---- the noise -------------------------------------------------------------------------------------

TEST(the_noise_is_that_of_nineteen_electrodes)
{
    // An electrode's eight rounds end with a word whose distance from their mean holds 7/8 sigma^2; a
    // sweep adds 8/7 of nineteen. Sixteen sweeps are a plain mean: 16 * 19 independent squares a finger.
    // Rounding to counts adds 1/12. Up to sigma 4 the trigger holds back one word in 40,000.
    static const double noises[] = {1, 1.5, 2.5, 4};
    const unsigned fingers = 1500;
    for (unsigned k = 0; k < 4; k++) {
        double sum = 0;
        for (unsigned f = 1; f <= fingers; f++) {
            emulated_finger finger;
            finger_init(&finger);
            finger.seed = 0x9E3779B97F4A7C15u * (4 * f + k);
            finger.sigma = noises[k];
            while (finger.tare.noise.sweeps < 16) {
                run_frames(&finger, BT_SWEEP_ROUNDS);
                assert_true(finger.t_s < 3);
            }
            assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
            sum += finger.tare.noise.count2;
        }
        double want = 19 * (noises[k] * noises[k] + 1.0 / 12);
        // Chi-square of n squares has a variance of 2 n. The published integer is the nearest.
        double off = 5 * want * sqrt(2.0 / (fingers * 16.0 * 19)) + 5 * 0.29 / sqrt(fingers);
        if (fabs(sum / fingers - want) > off) {
            fail_msg("sigma %.1f: %.2f count^2, not %.2f +- %.2f", noises[k], sum / fingers, want, off);
        }
    }
}

int main(void)
{
    return run_all(NULL, NULL);
}
