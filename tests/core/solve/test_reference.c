// The double reference against closed forms and sums by hand, and what holds of the kernels
// without any reference: symmetry, and refusal where there is no answer.
#include "support.h"

#include "lin2013.h"
#include "signal/signals.h"
#include "solve/poc.h"
#include "solve/solve.h"

#include <math.h>

#define RADIUS_MM 5.08

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

static void a_single_electrode_is_moved_to_the_surface(void **state)
{
    (void)state;
    for (int weights = 0; weights <= 2; weights++) {
        for (int i = 0; i < BT_ELECTRODES; i++) {
            double e[BT_ELECTRODES] = {0};
            double r[3];
            e[i] = -37.25;
            lin2013_result result = run(e, weights);
            for (int d = 0; d < 3; d++) {
                r[d] = bt_electrode_um[i][d] / 1000.0;
            }
            // Tip electrodes lie on a ray from the centre, the others on a spoke from the axis.
            double from_x = r[0] > 0 ? r[0] : 0;
            double length = sqrt(from_x * from_x + r[1] * r[1] + r[2] * r[2]);
            assert_near(result.poc_mm[0], r[0] > 0 ? r[0] * RADIUS_MM / length : r[0]);
            assert_near(result.poc_mm[1], r[1] * RADIUS_MM / length);
            assert_near(result.poc_mm[2], r[2] * RADIUS_MM / length);
        }
    }
}

static void two_points_of_contact_worked_by_hand(void **state)
{
    (void)state;
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

static void force_sums_worked_by_hand(void **state)
{
    (void)state;
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

static void torque_of_a_side_electrode_worked_by_hand(void **state)
{
    (void)state;
    // E1: r x n = (0.001204, -0.000276, 0.002272) mm; x is replaced by the lever c x F.
    double e[BT_ELECTRODES] = {[0] = -10};
    lin2013_result result = run(e, BT_POC_WEIGHTS_ABS_N2);
    assert_near(result.torque_sum[0], -0.01204);
    assert_near(result.torque_nmm[1], 0.00276);
    assert_near(result.torque_nmm[2], -0.02272);
    double length = sqrt(0.993 * 0.993 + 4.855 * 4.855 + 1.116 * 1.116);
    assert_near(result.torque_nmm[0], RADIUS_MM / length * (-4.855 * 2.2 - -1.116 * 9.56));
    // E4's arms are large: (y n_z - z n_y, z n_x - x n_z, x n_y - y n_x) = (0.001104, -1.76, 7.808).
    double side[BT_ELECTRODES] = {[3] = -10};
    result = run(side, BT_POC_WEIGHTS_ABS_N2);
    assert_near(result.torque_nmm[1], 17.6);
    assert_near(result.torque_nmm[2], -78.08);
}

static void many_frames_at_once_are_the_same_frames(void **state)
{
    (void)state;
    static uint16_t counts[20][BT_ELECTRODES], tare_q4[20][BT_ELECTRODES];
    double poc[20][3], force[20][3], torque[20][3];
    uint64_t seed = 9;
    lin2013_settings settings = {BT_POC_WEIGHTS_COMPRESS_N2, {1, 2, 3}, {4, 5}};
    for (int k = 0; k < 20; k++) {
        for (int i = 0; i < BT_ELECTRODES; i++) {
            counts[k][i] = (uint16_t)random_range(&seed, 0, 4095);
            tare_q4[k][i] = (uint16_t)random_range(&seed, 0, BT_E_MAX_Q4);
        }
        counts[k][k % BT_ELECTRODES] = BT_INVALID_COUNT;
    }
    lin2013_frames(20, counts[0], tare_q4[0], &settings, poc[0], force[0], torque[0]);
    for (int k = 0; k < 20; k++) {
        double e[BT_ELECTRODES];
        lin2013_result want;
        int32_t e_q4[BT_ELECTRODES];
        bt_signals_q4(counts[k], tare_q4[k], e_q4); // the core's own, so both sides agree on e
        assert_int_equal(e_q4[k % BT_ELECTRODES], 0);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = e_q4[i] / 16.0;
        }
        lin2013(e, &settings, &want);
        assert_memory_equal(poc[k], want.poc_mm, sizeof want.poc_mm);
        assert_memory_equal(force[k], want.force_n, sizeof want.force_n);
        assert_memory_equal(torque[k], want.torque_nmm, sizeof want.torque_nmm);
    }
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

static void mirrored_signals_give_exactly_mirrored_results(void **state)
{
    (void)state;
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
static void what_nobody_wants_is_invalid(void **state)
{
    (void)state;
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

static void assert_poc_refused(const int32_t e[BT_ELECTRODES], int weights)
{
    bt_point point = {{11, 22, 33}, {44, 55}};
    results out = kernel(e, weights);
    assert_true(out.flags & BT_FRAME_FLAG_POC_INVALID);
    assert_int_equal(out.torque_mnmm[0], INT32_MIN);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(out.poc_um[d], INT16_MIN);
    }
    assert_false(bt_poc(e, weights, &point));
    assert_true(point.um[0] == 11 && point.um[1] == 22 && point.um[2] == 33 && point.lever_yz[0] == 44);
}

static void no_signal_has_no_point_of_contact(void **state)
{
    (void)state;
    static const int32_t nothing[BT_ELECTRODES];
    for (int weights = 0; weights <= 2; weights++) {
        assert_poc_refused(nothing, weights);
        results out = kernel(nothing, weights);
        for (int d = 0; d < 3; d++) { // no signal is no force, and that is known
            assert_int_equal(out.force_100un[d], 0);
            assert_true(d == 0 || out.torque_mnmm[d] == 0);
        }
    }
}

static void bulges_alone_have_no_point_of_contact_by_compression(void **state)
{
    (void)state;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t e[BT_ELECTRODES] = {0};
        e[i] = 1;
        e[(i + 5) % BT_ELECTRODES] = BT_E_MAX_Q4;
        assert_poc_refused(e, BT_POC_WEIGHTS_COMPRESS_N1);
        assert_poc_refused(e, BT_POC_WEIGHTS_COMPRESS_N2);
        assert_false(kernel(e, BT_POC_WEIGHTS_ABS_N2).flags & BT_FRAME_FLAG_POC_INVALID);
        e[(i + 9) % BT_ELECTRODES] = -1; // one sixteenth of a count is enough for an answer
        assert_false(kernel(e, BT_POC_WEIGHTS_COMPRESS_N1).flags & BT_FRAME_FLAG_POC_INVALID);
    }
}

static void every_point_of_contact_lies_on_the_surface(void **state)
{
    (void)state;
    uint64_t seed = 11;
    for (int k = 0; k < 50000; k++) {
        int32_t e[BT_ELECTRODES];
        bt_point point;
        int64_t size = BT_E_MAX_Q4 >> (k % 16);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = (int32_t)random_range(&seed, -size, -1);
        }
        assert_true(bt_poc(e, k % 3, &point));
        double x = point.um[0] > 0 ? point.um[0] : 0;
        double length = sqrt(x * x + (double)point.um[1] * point.um[1] + (double)point.um[2] * point.um[2]);
        assert_true(fabs(length - 5080) < 0.5 * 1.7320508 + 0.2); // rounding to um, and the length's own
        assert_true(point.um[2] < 0 && point.um[0] >= -13600);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_single_electrode_is_moved_to_the_surface),
        cmocka_unit_test(two_points_of_contact_worked_by_hand),
        cmocka_unit_test(force_sums_worked_by_hand),
        cmocka_unit_test(torque_of_a_side_electrode_worked_by_hand),
        cmocka_unit_test(many_frames_at_once_are_the_same_frames),
        cmocka_unit_test(what_nobody_wants_is_invalid),
        cmocka_unit_test(mirrored_signals_give_exactly_mirrored_results),
        cmocka_unit_test(no_signal_has_no_point_of_contact),
        cmocka_unit_test(bulges_alone_have_no_point_of_contact_by_compression),
        cmocka_unit_test(every_point_of_contact_lies_on_the_surface),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
