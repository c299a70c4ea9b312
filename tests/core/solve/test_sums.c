// The generated sums of force and torque (signal/sums_gen.h) are the plain sums over Table 1, within the
// bounds that the core asserts; those of coordinates are test_moments.c's.
//
// The generated code has no branch and does nothing but add, subtract and multiply by constants, so that a
// result is a linear form of the inputs: the coefficients, which one electrode at a time shows, determine it.
// Pairs and random frames could show no more. The two divisions, done to the torques last, are not linear
// and are tried apart. tests/proofs has the steps in between.
#include "support.h"

#include "signal/sums_gen.h"
#include "wire/sensor_gen.h"

#define FRAMES 20000

typedef void check_frame(const int32_t e_q4[BT_ELECTRODES]);

static int64_t plain(const int32_t e[BT_ELECTRODES], const int16_t column[BT_ELECTRODES][3], int axis)
{
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += (int64_t)e[i] * column[i][axis];
    }
    return sum;
}

// Each electrode alone, each pair of them, every corner that makes a sum largest, and random frames.
static void over_all_frames(check_frame *check)
{
    const int32_t sizes[] = {1, 256, BT_E_MAX_Q4};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int j = 0; j < BT_ELECTRODES; j++) {
            for (int k = 0; k < 9; k++) {
                int32_t e[BT_ELECTRODES] = {0};
                e[i] = -sizes[k % 3];
                e[j] = sizes[k / 3];
                check(e);
            }
        }
    }
    for (int d = 0; d < 3; d++) {
        for (int side = 0; side < 4; side++) {
            int32_t e[BT_ELECTRODES];
            for (int i = 0; i < BT_ELECTRODES; i++) {
                const int32_t sign[] = {bt_normal_milli[i][d], bt_arm_nm[i][d]};
                e[i] = (sign[side / 2] > 0) == side % 2 ? BT_E_MAX_Q4 : -BT_E_MAX_Q4;
            }
            check(e);
        }
    }
    uint64_t seed = 17;
    for (int k = 0; k < FRAMES; k++) {
        int32_t e[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            int32_t end = random_u64(&seed) & 1 ? BT_E_MAX_Q4 : -BT_E_MAX_Q4;
            e[i] = k % 4 ? (int32_t)random_range(&seed, -BT_E_MAX_Q4, BT_E_MAX_Q4) : end;
        }
        check(e);
    }
}

// ---- force and torque ----------------------------------------------------------------------------------

static void check_force(const int32_t e_q4[BT_ELECTRODES])
{
    int32_t sum[3];
    bt_sums_force(e_q4, sum);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(sum[d], plain(e_q4, bt_normal_milli, d));
        assert_true(llabs(sum[d]) <= BT_SUM_NORMAL_MAX_Q4_MILLI);
    }
}

TEST(force_sums_are_those_over_table_1)
{
    over_all_frames(check_force);
    int64_t largest = 0;
    for (int d = 0; d < 3; d++) {
        int64_t sum = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            sum += (int64_t)BT_E_MAX_Q4 * labs(bt_normal_milli[i][d]);
        }
        largest = sum > largest ? sum : largest;
    }
    assert_int_equal(largest, BT_SUM_NORMAL_MAX_Q4_MILLI);
}

// An arm ahead of the seam is rounded to 1/2^BT_SUMS_ARM_BITS of the unit; together they lose under two units
// are cut.
static void check_torque(const int32_t e_q4[BT_ELECTRODES])
{
    int32_t sum[2];
    bt_sums_torque(e_q4, sum);
    for (int d = 1; d < 3; d++) {
        int64_t arms_nm = 0, rounded_nm = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            arms_nm += (int64_t)e_q4[i] * bt_arm_nm[i][d];
            rounded_nm += bt_electrode_um[i][0] > 0 ? llabs(e_q4[i]) * BT_SUMS_TORQUE_UNIT_NM : 0;
        }
        const int64_t off_nm = llabs((int64_t)sum[d - 1] * BT_SUMS_TORQUE_UNIT_NM - arms_nm);
        assert_true(off_nm < 2 * BT_SUMS_TORQUE_UNIT_NM + (rounded_nm >> (BT_SUMS_ARM_BITS + 1)) + 1);
        assert_true(llabs(sum[d - 1]) <= BT_SUM_ARM_MAX_Q4_NM / BT_SUMS_TORQUE_UNIT_NM + 2
                                             + BT_ELECTRODES * (int64_t)BT_E_MAX_Q4);
    }
}

TEST(torque_sums_are_those_over_table_1_to_their_rounding)
{
    over_all_frames(check_torque);
    const int32_t whole = 1 << BT_SUMS_ARM_BITS; // of so much nothing is cut
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t e_q4[BT_ELECTRODES] = {0}, sum[2];
        e_q4[i] = whole;
        bt_sums_torque(e_q4, sum);
        for (int d = 1; d < 3; d++) {
            const int64_t off =
                llabs((int64_t)sum[d - 1] * BT_SUMS_TORQUE_UNIT_NM - (int64_t)whole * bt_arm_nm[i][d]);
            assert_true(bt_electrode_um[i][0] > 0 ? 2 * off <= BT_SUMS_TORQUE_UNIT_NM : off == 0);
        }
    }
}

// ---- Table 1 -------------------------------------------------------------------------------------------

TEST(an_arm_is_the_place_times_the_normal)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        const int16_t *r = bt_electrode_um[i], *n = bt_normal_milli[i];
        for (int d = 0; d < 3; d++) {
            const int a = (d + 1) % 3, b = (d + 2) % 3;
            assert_int_equal(bt_arm_nm[i][d], r[a] * n[b] - r[b] * n[a]);
        }
    }
}

// So no weighted mean of them lies above the axis, or on it: a point of contact always has a direction.
TEST(no_electrode_is_above_the_one_nearest_to_the_axis)
{
    int highest_um = INT16_MIN, farthest_um = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        highest_um = bt_electrode_um[i][2] > highest_um ? bt_electrode_um[i][2] : highest_um;
        for (int d = 0; d < 3; d++) {
            farthest_um = abs(bt_electrode_um[i][d]) > farthest_um ? abs(bt_electrode_um[i][d]) : farthest_um;
        }
    }
    assert_int_equal(highest_um, BT_ELECTRODE_Z_MAX_UM);
    assert_int_equal(farthest_um, BT_ELECTRODE_MAX_UM);
}
