// Properties of the kernels that need no reference: symmetry, and refusal where there is no answer. Against
// the formulas: test_kernels.c, tests/crosscheck.
#include "support.h"

#include "solve/poc.h"
#include "solve/solve.h"

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
    out.flags = bt_solve(e_q4, &settings, BT_WANT_ALL, out.poc_um, out.force_100un, out.torque_mnmm, NULL);
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

// Nothing, or nothing compressed; one sixteenth of a count is enough for an answer.
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
