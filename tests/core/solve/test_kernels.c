// The integer kernels against the double reference (firmware/reference), within kernel_bounds.h.
#include "support.h"

#include "fixed_point.h"
#include "kernel_bounds.h"
#include "lin2013.h"
#include "solve/poc.h"
#include "solve/solve.h"
#include "solve/wrench.h"

#include <math.h>

typedef struct {
    int32_t force_nn[3];
    int32_t torque_nn[2];
} gains_nn;

static const gains_nn defaults = {{1063440, 252325, 2262234}, {2262234, 252325}};

typedef struct {
    double poc_um;
    double force_mn;
    double torque_yz_mnmm;
    double torque_x_mnmm;
} errors;

static errors worst;
static long frames_checked;

static lin2013_result reference(const int32_t e_q4[BT_ELECTRODES], int weights, const gains_nn *gains)
{
    lin2013_settings in = {.poc_weights = weights};
    lin2013_result out;
    double e[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = e_q4[i] / 16.0;
    }
    for (int d = 0; d < 3; d++) {
        in.force_gain[d] = gains->force_nn[d] * 1e-9;
    }
    for (int d = 0; d < 2; d++) {
        in.torque_gain[d] = gains->torque_nn[d] * 1e-9;
    }
    lin2013(e, &in, &out);
    return out;
}

static void raise_to(double *top, double value)
{
    *top = value > *top ? value : *top;
}

static double size_of(const int32_t e_q4[BT_ELECTRODES])
{
    double sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += fabs(e_q4[i] / 16.0);
    }
    return sum;
}

static void check_wrench(const lin2013_result *want, double size, const gains_nn *gains,
                         const int32_t force_100un[3], const int32_t torque_mnmm[3])
{
    for (int d = 0; d < 3; d++) {
        double error = fabs(force_100un[d] * 0.1 - want->force_n[d] * 1000);
        raise_to(&worst.force_mn, error);
        assert_true(error <= FORCE_BOUND_MN);
    }
    for (int d = 1; d < 3; d++) {
        double error = fabs(torque_mnmm[d] - want->torque_nmm[d] * 1000);
        double gain_n = fabs(gains->torque_nn[d - 1] * 1e-9);
        double sum = fabs(want->torque_sum[d]) * 1000;
        if (gains == &defaults) {
            raise_to(&worst.torque_yz_mnmm, error);
        }
        assert_true(error <= torque_yz_bound_mnmm(size, gain_n, sum));
    }
}

static void check_poc(const lin2013_result *want, const int16_t poc_um[3], int32_t torque_x_mnmm)
{
    double square = 0;
    for (int d = 0; d < 3; d++) {
        double error = poc_um[d] - want->poc_mm[d] * 1000;
        square += error * error;
    }
    raise_to(&worst.poc_um, sqrt(square));
    assert_true(sqrt(square) <= POC_BOUND_UM);

    double force = fabs(want->force_n[1]) + fabs(want->force_n[2]);
    double error = fabs(torque_x_mnmm - want->torque_nmm[0] * 1000);
    raise_to(&worst.torque_x_mnmm, error / (1 + force));
    assert_true(error <= torque_x_bound_mnmm(force));
}

static void check_all_weights(const int32_t e_q4[BT_ELECTRODES], const gains_nn *gains)
{
    double size = size_of(e_q4);
    for (int weights = 0; weights <= 2; weights++) {
        bt_solve_settings settings = {.poc_weights = weights,
                                      .gains = bt_gains_from(gains->force_nn, gains->torque_nn)};
        int16_t poc_um[3];
        int32_t force_100un[3], torque_mnmm[3];
        uint32_t flags = bt_solve(e_q4, &settings, BT_WANT_ALL, poc_um, force_100un, torque_mnmm);
        lin2013_result want = reference(e_q4, weights, gains);
        check_wrench(&want, size, gains, force_100un, torque_mnmm);
        if (isnan(want.poc_mm[0])) {
            assert_int_equal(flags, BT_FRAME_FLAG_POC_INVALID);
            assert_int_equal(torque_mnmm[0], BT_INVALID_I32);
            for (int d = 0; d < 3; d++) {
                assert_int_equal(poc_um[d], BT_INVALID_I16);
            }
        } else {
            assert_int_equal(flags, 0);
            check_poc(&want, poc_um, torque_mnmm[0]);
        }
        frames_checked++;
    }
}

static gains_nn random_gains(uint64_t *seed)
{
    gains_nn gains;
    for (int d = 0; d < 3; d++) {
        gains.force_nn[d] = (int32_t)random_range(seed, -BT_GAIN_MAX_NN, BT_GAIN_MAX_NN);
        gains.torque_nn[d % 2] = (int32_t)random_range(seed, -BT_GAIN_MAX_NN, BT_GAIN_MAX_NN);
    }
    return gains;
}

static const gains_nn largest_gains = {{BT_GAIN_MAX_NN, -BT_GAIN_MAX_NN, BT_GAIN_MAX_NN},
                                       {-BT_GAIN_MAX_NN, BT_GAIN_MAX_NN}};

static void single_electrodes_at_every_size(void **state)
{
    (void)state;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int32_t size = 1; size <= BT_E_MAX_Q4; size = size * 2 + (size % 3 == 0)) {
            int32_t e[BT_ELECTRODES] = {0};
            e[i] = -size;
            check_all_weights(e, &defaults);
            check_all_weights(e, &largest_gains);
            e[i] = size;
            check_all_weights(e, &defaults);
        }
    }
}

static void all_electrodes_equal(void **state)
{
    (void)state;
    for (int32_t size = -BT_E_MAX_Q4; size <= BT_E_MAX_Q4; size += size > -40 && size < 40 ? 1 : 7) {
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = size;
        }
        check_all_weights(e, &defaults);
        check_all_weights(e, &largest_gains);
    }
}

static void corners_of_the_box(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int k = 0; k < 30000; k++) {
        // Corners, then corners with zeros among them; the first two are all down and all up.
        uint64_t signs = k < 2 ? 0 - (uint64_t)k : random_u64(&seed);
        uint64_t zeros = k % 2 ? random_u64(&seed) : 0;
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = zeros >> i & 1 ? 0 : signs >> (i + 20) & 1 ? BT_E_MAX_Q4 : -BT_E_MAX_Q4;
        }
        check_all_weights(e, k % 3 ? &defaults : &largest_gains);
    }
}

static void every_third_of_all_corners(void **state)
{
    (void)state;
    for (uint32_t signs = 0; signs < 1u << BT_ELECTRODES; signs += 3) {
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = signs >> i & 1 ? BT_E_MAX_Q4 : -BT_E_MAX_Q4;
        }
        check_all_weights(e, &largest_gains);
    }
}

static void corners_that_make_every_sum_largest(void **state)
{
    (void)state;
    for (int d = 0; d < 3; d++) {
        for (int up = -1; up <= 1; up += 2) {
            int32_t by_normal[BT_ELECTRODES], by_arm[BT_ELECTRODES], by_place[BT_ELECTRODES];
            for (int i = 0; i < BT_ELECTRODES; i++) {
                by_normal[i] = (bt_normal_milli[i][d] > 0 ? up : -up) * BT_E_MAX_Q4;
                by_arm[i] = (bt_arm_nm[i][d] > 0 ? up : -up) * BT_E_MAX_Q4;
                by_place[i] = (bt_electrode_um[i][d] > 0 ? up : -up) * BT_E_MAX_Q4;
            }
            check_all_weights(by_normal, &largest_gains);
            check_all_weights(by_arm, &largest_gains);
            check_all_weights(by_place, &largest_gains);
        }
    }
}

static void signals_of_one_lsb(void **state)
{
    (void)state;
    uint64_t seed = 6;
    for (int k = 0; k < 20000; k++) {
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = (int32_t)random_range(&seed, -1, 1);
        }
        check_all_weights(e, &defaults);
    }
}

static int64_t moment_x(const int32_t e[BT_ELECTRODES], int power)
{
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += (int64_t)e[i] * (power == 2 ? e[i] : -1) * bt_electrode_um[i][0];
    }
    return sum;
}

// n = 1: E10 (1299 um) and E17 (-2800 um) reach every whole number between them.
static void contacts_at_the_seam_with_linear_weights(void **state)
{
    (void)state;
    int hits[7] = {0};
    for (int32_t a = 1; a <= BT_E_MAX_Q4; a++) {
        for (int64_t want = -3; want <= 3; want++) {
            if ((1299 * (int64_t)a - want) % 2800 != 0) {
                continue;
            }
            int32_t e[BT_ELECTRODES] = {[9] = -a, [16] = (int32_t)(-(1299 * (int64_t)a - want) / 2800)};
            assert_int_equal(moment_x(e, 1), want);
            check_all_weights(e, &defaults);
            hits[want + 3]++;
        }
    }
    for (int k = 0; k < 7; k++) {
        assert_true(hits[k] > 10);
    }
}

// n = 2: squares of ever smaller signals bring a random frame's N_x as near to 0 as they can.
static void contacts_at_the_seam_with_square_weights(void **state)
{
    (void)state;
    static const int forward[] = {6, 7, 8, 9, 0, 10};   // E7 E8 E9 E10 E1 E11
    static const int backward[] = {18, 4, 3, 2, 16, 1}; // E19 E5 E4 E3 E17 E2
    uint64_t seed = 7;
    int near = 0, sides[2] = {0};
    for (int k = 0; k < 20000; k++) {
        int32_t e[BT_ELECTRODES] = {0};
        e[5] = -(int32_t)random_range(&seed, 0, 30000);
        e[17] = -(int32_t)random_range(&seed, 0, 9000);
        for (int step = 0; step < 6; step++) {
            int64_t sum = moment_x(e, 2);
            int i = sum < 0 ? forward[step] : backward[step];
            double size = sqrt(fabs((double)sum / bt_electrode_um[i][0]));
            // Cut off, or one too many: both sides of the seam are reached.
            e[i] =
                -(int32_t)(size > BT_E_MAX_Q4 - 1 ? BT_E_MAX_Q4 : size + (double)random_range(&seed, 0, 1));
        }
        double weight = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            weight += (double)e[i] * e[i];
        }
        near += fabs((double)moment_x(e, 2) / weight) < 1; // um
        sides[moment_x(e, 2) > 0]++;
        check_all_weights(e, &defaults);
    }
    assert_true(near > 5000 && sides[0] > 1000 && sides[1] > 1000);
}

static void random_frames_in_six_sizes(void **state)
{
    (void)state;
    static const int32_t sizes[6] = {16, 80, 800, 8000, 32000, BT_E_MAX_Q4};
    uint64_t seed = 8;
    for (int k = 0; k < 200000; k++) {
        int32_t size = sizes[k % 6];
        int32_t top = k / 6 % 2 ? size : size / 4; // mostly compressed, or evenly mixed
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = (int32_t)random_range(&seed, -size, top);
        }
        gains_nn gains = random_gains(&seed);
        check_all_weights(e, k % 4 ? &defaults : &gains);
    }
}

// At default gains; pressed frames of every size, in bins of the force in y and z.
static void torque_x_is_good_to_2_mnmm_rms_up_to_40_n(void **state)
{
    (void)state;
    static const double top_n[4] = {5, 10, 20, 40};
    double squares[4] = {0};
    int frames[4] = {0};
    uint64_t seed = 9;
    for (int k = 0; k < 100000; k++) {
        int32_t e[BT_ELECTRODES];
        int64_t size = random_range(&seed, 16, BT_E_MAX_Q4);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = -(int32_t)random_range(&seed, 0, size);
        }
        bt_solve_settings settings = {.poc_weights = k % 3,
                                      .gains = bt_gains_from(defaults.force_nn, defaults.torque_nn)};
        int16_t poc_um[3];
        int32_t force_100un[3], torque_mnmm[3];
        if (bt_solve(e, &settings, BT_WANT_ALL, poc_um, force_100un, torque_mnmm) != 0) {
            continue;
        }
        lin2013_result want = reference(e, k % 3, &defaults);
        double force = hypot(want.force_n[1], want.force_n[2]);
        for (int bin = 0; bin < 4; bin++) {
            if (force <= top_n[bin] && (bin == 0 || force > top_n[bin - 1])) {
                double error = torque_mnmm[0] - want.torque_nmm[0] * 1000;
                squares[bin] += error * error;
                frames[bin]++;
            }
        }
    }
    for (int bin = 0; bin < 4; bin++) {
        assert_true(frames[bin] > 500);
        double rms = sqrt(squares[bin] / frames[bin]);
        print_message("torque x up to %.0f N: %.2f mN*mm RMS\n", top_n[bin], rms);
        assert_true(rms <= 2);
    }
}

// The bounds above are what can be proved frame by frame; this is what the headers promise.
static void the_worst_of_all_is_within_what_is_promised(void **state)
{
    (void)state;
    assert_true(frames_checked > 900000);
    assert_true(worst.poc_um <= 1.1);
    assert_true(worst.force_mn <= 0.06);
}

static int print_worst(void **state)
{
    (void)state;
    print_message("worst of %ld: PoC %.4f um, force %.5f mN, torque y,z %.4f, x %.4f mN*mm per (1 + N)\n",
                  frames_checked, worst.poc_um, worst.force_mn, worst.torque_yz_mnmm, worst.torque_x_mnmm);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(single_electrodes_at_every_size),
        cmocka_unit_test(all_electrodes_equal),
        cmocka_unit_test(corners_of_the_box),
        cmocka_unit_test(every_third_of_all_corners),
        cmocka_unit_test(corners_that_make_every_sum_largest),
        cmocka_unit_test(signals_of_one_lsb),
        cmocka_unit_test(contacts_at_the_seam_with_linear_weights),
        cmocka_unit_test(contacts_at_the_seam_with_square_weights),
        cmocka_unit_test(random_frames_in_six_sizes),
        cmocka_unit_test(torque_x_is_good_to_2_mnmm_rms_up_to_40_n),
        cmocka_unit_test(the_worst_of_all_is_within_what_is_promised),
    };
    return cmocka_run_group_tests(tests, NULL, print_worst);
}
