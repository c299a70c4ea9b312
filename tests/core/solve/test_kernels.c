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
} errors;

static errors worst;

// Bins of torque x at the default gains, by the force in y and z: up to so many N.
static const double top_n[4] = {5, 10, 20, 40};
static double squares[4];
static int counted[4];

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
        double sum = gain_n > 0 ? fabs(want->torque_nmm[d]) / gain_n * 1000 : 0;
        if (gains == &defaults) {
            raise_to(&worst.torque_yz_mnmm, error);
        }
        assert_true(error <= torque_yz_bound_mnmm(size, gain_n, sum));
    }
}

static void check_poc(const lin2013_result *want, const gains_nn *gains, const int16_t poc_um[3],
                      int32_t torque_x_mnmm)
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
    assert_true(error <= torque_x_bound_mnmm(force));
    for (int bin = 0; gains == &defaults && bin < 4; bin++) {
        if (force <= top_n[bin]) {
            squares[bin] += error * error;
            counted[bin]++;
            break;
        }
    }
}

static void check_all_weights(const int32_t e_q4[BT_ELECTRODES], const gains_nn *gains)
{
    double size = size_of(e_q4);
    for (int weights = 0; weights <= 2; weights++) {
        bt_solve_settings settings = {.poc_weights = weights,
                                      .gains = bt_gains_from(gains->force_nn, gains->torque_nn)};
        int16_t poc_um[3];
        int32_t force_100un[3], torque_mnmm[3];
        uint32_t flags = bt_solve(e_q4, &settings, BT_WANT_ALL, poc_um, force_100un, torque_mnmm, NULL);
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
            check_poc(&want, gains, poc_um, torque_mnmm[0]);
        }
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

TEST(single_electrodes_at_every_size)
{
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

TEST(all_electrodes_equal)
{
    for (int32_t size = -BT_E_MAX_Q4; size <= BT_E_MAX_Q4; size += size > -40 && size < 40 ? 1 : 7) {
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = size;
        }
        check_all_weights(e, &defaults);
        check_all_weights(e, &largest_gains);
    }
}

TEST(corners_of_the_box)
{
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

TEST(corners_that_make_every_sum_largest)
{
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

// n = 1: E10 (1299 um) and E17 (-2800 um) reach every whole number between them.
TEST(contacts_at_the_seam)
{
    int hits[7] = {0};
    for (int32_t a = 1; a <= BT_E_MAX_Q4; a++) {
        for (int64_t want = -3; want <= 3; want++) {
            if ((1299 * (int64_t)a - want) % 2800 != 0) {
                continue;
            }
            int32_t e[BT_ELECTRODES] = {[9] = -a, [16] = (int32_t)(-(1299 * (int64_t)a - want) / 2800)};
            check_all_weights(e, &defaults);
            hits[want + 3]++;
        }
    }
    for (int k = 0; k < 7; k++) {
        assert_true(hits[k] > 10);
    }
}

TEST(random_frames_in_all_sizes)
{
    static const int32_t sizes[7] = {1, 16, 80, 800, 8000, 32000, BT_E_MAX_Q4};
    uint64_t seed = 8;
    for (int k = 0; k < 200000; k++) {
        int32_t size = sizes[k % 7];
        int32_t top = k / 7 % 2 ? size : size / 4; // mostly compressed, or evenly mixed
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = (int32_t)random_range(&seed, -size, top);
        }
        gains_nn gains = random_gains(&seed);
        check_all_weights(e, k % 4 ? &defaults : &gains);
    }
}

// The bounds above can be proved frame by frame; the headers promise this one.
TEST(the_worst_of_all_is_within_what_is_promised)
{
    print_message("worst: PoC %.4f um, force %.5f mN, torque y,z %.4f mN*mm\n", worst.poc_um, worst.force_mn,
                  worst.torque_yz_mnmm);
    assert_true(worst.poc_um <= 1.1);
    assert_true(worst.force_mn <= 0.06);
    for (int bin = 0; bin < 4; bin++) {
        double rms = sqrt(squares[bin] / counted[bin]);
        print_message("torque x up to %.0f N: %.2f mN*mm RMS of %d\n", top_n[bin], rms, counted[bin]);
        assert_true(counted[bin] > 500 && rms <= 2);
    }
}
