// The double reference against sums by hand (against the formulas in NumPy: tests/crosscheck), and what holds
// of the kernels without any reference: symmetry, and refusal where there is no answer.
#include "support.h"

#include "lin2013.h"
#include "solve/poc.h"
#include "solve/solve.h"

#include <math.h>

static void assert_near(double value, double want)
{
    if (!(fabs(value - want) < 1e-9)) {
        fail_msg("%.12f is not %.12f", value, want);
    }
}

static lin2013_result run(const double e[BT_ELECTRODES], int weights)
{
    lin2013_settings settings = {.poc_weights = weights, .force_gain = {1, 1, 1}, .torque_gain = {1, 1}};
    lin2013_result result;
    lin2013(e, &settings, &result);
    return result;
}

TEST(two_points_of_contact_worked_by_hand)
{
    // E17 and E18, twice as strong: both at y = 0, z = -5.08; x = (-2.8 - 4 * 9.8) / 5 for n = 2.
    double e[BT_ELECTRODES] = {[16] = -10, [17] = -20};
    lin2013_result result = run(e, BT_POC_WEIGHTS_ABS_N2);
    assert_near(result.poc_mm[0], -8.4);
    assert_near(result.poc_mm[1], 0);
    assert_near(result.poc_mm[2], -5.08);
    result = run(e, BT_POC_WEIGHTS_COMPRESS_N1);
    assert_near(result.poc_mm[0], (-2.8 - 2 * 9.8) / 3);
    // A bulge counts in the paper's weights alone.
    e[16] = 10;
    assert_near(run(e, BT_POC_WEIGHTS_ABS_N2).poc_mm[0], -8.4);
    assert_near(run(e, BT_POC_WEIGHTS_COMPRESS_N1).poc_mm[0], -9.8);
    assert_near(run(e, BT_POC_WEIGHTS_COMPRESS_N2).poc_mm[0], -9.8);
}

TEST(force_sums_worked_by_hand)
{
    double e[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = -1;
    }
    // x: 2 * 0.196 + 4 * 0.5;  z: 2 * 0.22 + 6 * 0.722 + 4 * 0.22 + 4 * 0.866 + 3
    lin2013_result result = run(e, BT_POC_WEIGHTS_ABS_N2);
    assert_near(result.force_n[0], -2.392);
    assert_near(result.force_n[1], 0);
    assert_near(result.force_n[2], 12.116);
    // A press on the pad's middle pushes the finger up (z dorsal), and turns it about y by x * F_z.
    double pad[BT_ELECTRODES] = {[16] = -100};
    result = run(pad, BT_POC_WEIGHTS_ABS_N2);
    assert_near(result.force_n[2], 100);
    assert_near(result.torque_nmm[1], 2.8 * 100);
    assert_near(result.torque_nmm[0], 0);
    assert_near(result.torque_nmm[2], 0);
}

// ---- the kernels by themselves -----------------------------------------------------------------

static const int32_t force_nn[3] = {1063440, 252325, 2262234};
static const int32_t torque_nn[2] = {2262234, 252325};

typedef struct {
    uint32_t flags;
    int16_t poc_um[3];
    int32_t force_100un[3];
    int32_t torque_mnmm[3];
} results;

static results kernel(const int32_t e_q4[BT_ELECTRODES], int weights)
{
    results out;
    bt_solve_settings settings = {.poc_weights = weights, .gains = bt_gains_from(force_nn, torque_nn)};
    out.flags = bt_solve(e_q4, &settings, BT_WANT_ALL, out.poc_um, out.force_100un, out.torque_mnmm);
    return out;
}

TEST(mirrored_signals_give_exactly_mirrored_results)
{
    // E1..E6 mirror E11..E16, E8 mirrors E9, the rest lies in the plane of symmetry.
    static const int mirror[BT_ELECTRODES] = {10, 11, 12, 13, 14, 15, 6,  8,  7, 9,
                                              0,  1,  2,  3,  4,  5,  16, 17, 18};
    uint64_t seed = 10;
    for (int k = 0; k < 60000; k++) {
        int32_t e[BT_ELECTRODES], mirrored[BT_ELECTRODES];
        int64_t size = BT_E_MAX_Q4 >> (k % 16);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = (int32_t)random_range(&seed, -size, size);
        }
        for (int i = 0; i < BT_ELECTRODES; i++) {
            mirrored[i] = e[mirror[i]];
        }
        results a = kernel(e, k % 3);
        results b = kernel(mirrored, k % 3);
        assert_int_equal(a.flags, b.flags);
        assert_int_equal(a.force_100un[0], b.force_100un[0]);
        assert_int_equal(a.force_100un[1], -b.force_100un[1]);
        assert_int_equal(a.force_100un[2], b.force_100un[2]);
        assert_int_equal(a.torque_mnmm[1], b.torque_mnmm[1]);
        assert_int_equal(a.torque_mnmm[2], -b.torque_mnmm[2]);
        if (!(a.flags & BT_FRAME_FLAG_POC_INVALID)) {
            assert_int_equal(a.torque_mnmm[0], -b.torque_mnmm[0]);
            assert_int_equal(a.poc_um[0], b.poc_um[0]);
            assert_int_equal(a.poc_um[1], -b.poc_um[1]);
            assert_int_equal(a.poc_um[2], b.poc_um[2]);
        }
    }
}

// Whatever is asked for is what comes with everything; the rest is marked, never left or made up.
TEST(what_nobody_wants_is_invalid)
{
    uint64_t seed = 10;
    for (int k = 0; k < 3000; k++) {
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = k % 20 == 0 ? 0 : (int32_t)random_range(&seed, -8000, 2000);
        }
        bt_solve_settings settings = {.poc_weights = k % 3, .gains = bt_gains_from(force_nn, torque_nn)};
        int16_t all_poc[3], poc[3];
        int32_t all_force[3], all_torque[3], force[3], torque[3];
        uint32_t all_flags = bt_solve(e, &settings, BT_WANT_ALL, all_poc, all_force, all_torque);
        for (uint32_t wanted = 0; wanted <= BT_WANT_ALL; wanted++) {
            uint32_t flags = bt_solve(e, &settings, wanted, poc, force, torque);
            assert_int_equal(flags, wanted & (BT_WANT_POC | BT_WANT_TORQUE) ? all_flags : 0);
            for (int d = 0; d < 3; d++) {
                assert_int_equal(poc[d], wanted & BT_WANT_POC ? all_poc[d] : BT_INVALID_I16);
                assert_int_equal(force[d], wanted & BT_WANT_FORCE ? all_force[d] : BT_INVALID_I32);
                assert_int_equal(torque[d], wanted & BT_WANT_TORQUE ? all_torque[d] : BT_INVALID_I32);
            }
        }
    }
}

// Nothing, or nothing that is compressed; one sixteenth of a count is enough for an answer.
TEST(without_weight_there_is_no_point_of_contact)
{
    for (int weights = 0; weights <= 2; weights++) {
        for (int bulge = 0; bulge <= 1; bulge++) {
            int32_t e[BT_ELECTRODES] = {[4] = bulge, [9] = bulge * BT_E_MAX_Q4};
            bool refused = bulge == 0 || weights != BT_POC_WEIGHTS_ABS_N2;
            bt_point point = {{11, 22, 33}, {44, 55}};
            results out = kernel(e, weights);
            assert_int_equal(out.flags, refused ? BT_FRAME_FLAG_POC_INVALID : 0);
            assert_int_equal(out.torque_mnmm[0] == BT_INVALID_I32, refused);
            assert_int_equal(bt_poc(e, weights, &point), !refused);
            for (int d = 0; d < 3; d++) {
                assert_int_equal(out.poc_um[d] == BT_INVALID_I16, refused);
                assert_true(bulge != 0
                            || out.force_100un[d] == 0); // no signal is no force, and that is known
                assert_int_equal(point.um[d] == 11 * (d + 1), refused);
            }
            e[13] = -1;
            assert_int_equal(kernel(e, weights).flags, 0);
        }
    }
}

int main(void)
{
    return run_all(NULL, NULL);
}
