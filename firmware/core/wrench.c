#include "wrench.h"

#include "fix.h"
#include "fold_gen.h"

// sum * gain / 1.6e9 is 100 uN: 1/16 count * 1/1000 * nN. sum * gain / 1e9 is mN*mm: count * um * nN.
// Multiplying by 2^bits / divisor and shifting replaces both divisions.
#define FORCE_DIVISOR  1600000000LL
#define FORCE_BITS     34
#define TORQUE_DIVISOR 1000000000LL
#define TORQUE_BITS    33

// The lever: 1/16 um * 100 uN is 1/160000 mN*mm; products are split at 13 bits, and 2^13 / 160000 is
// then applied as a multiplier of 2^33.
#define LEVER_SPLIT_BITS 13
#define LEVER_BITS       33
#define LEVER_MULTIPLIER ((uint32_t)(((1ull << (LEVER_BITS + LEVER_SPLIT_BITS)) + 80000) / 160000))

#define FORCE_MAX_100UN (BT_SUM_NORMAL_MAX_Q4_MILLI * BT_GAIN_MAX_NN / FORCE_DIVISOR + 1)
#define FINE_MAX_UM_Q4  (16LL * BT_CORE_RADIUS_UM + 1)

// The bounds below are for gains of one range, the same on both sides of 0.
#define HAS_GAIN_RANGE(name)                                                                                 \
    (BT_SETTING_##name##_MAX == BT_GAIN_MAX_NN && BT_SETTING_##name##_MIN == -BT_GAIN_MAX_NN)
_Static_assert(HAS_GAIN_RANGE(FORCE_GAIN_X_NN) && HAS_GAIN_RANGE(FORCE_GAIN_Y_NN)
                   && HAS_GAIN_RANGE(FORCE_GAIN_Z_NN),
               "the force gains' ranges must be one");
_Static_assert(HAS_GAIN_RANGE(TORQUE_GAIN_Y_NN) && HAS_GAIN_RANGE(TORQUE_GAIN_Z_NN),
               "the torque gains' ranges must be that of the force gains");

_Static_assert(BT_SUM_NORMAL_MAX_Q4_MILLI <= INT32_MAX, "a force sum must fit int32");
_Static_assert(BT_FOLD_ARM_HI_MAX <= INT32_MAX && BT_FOLD_ARM_LO_MAX <= INT32_MAX,
               "torque sums must fit int32");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << FORCE_BITS) / FORCE_DIVISOR <= 1 << 30,
               "a force gain must fit bt_scale");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << TORQUE_BITS) / TORQUE_DIVISOR <= 1 << 30,
               "a torque gain must fit bt_scale");
_Static_assert(BT_FOLD_ARM_HI_MAX + (BT_FOLD_ARM_LO_MAX >> BT_FOLD_ARM_SPLIT_BITS) < INT32_MAX,
               "a joined torque sum must fit int32");
_Static_assert(1 << BT_FOLD_ARM_SPLIT_BITS == 16 * BT_FOLD_ARM_PER_UM,
               "a joined torque sum is in count * um");
_Static_assert(LEVER_MULTIPLIER <= 1 << 30, "the lever's factor must fit bt_scale");
_Static_assert(2 * FINE_MAX_UM_Q4 * ((FORCE_MAX_100UN >> LEVER_SPLIT_BITS) + 1) < INT32_MAX / 2,
               "the lever's high products must fit int32");
_Static_assert(2 * FINE_MAX_UM_Q4 << LEVER_SPLIT_BITS < INT32_MAX, "the lever's low products must fit int32");

static int32_t multiplier(int32_t gain_nn, int bits, int64_t divisor)
{
    return (int32_t)bt_div_round(gain_nn * ((int64_t)1 << bits), divisor);
}

bt_gains bt_gains_from(const int32_t force_nn[3], const int32_t torque_nn[2])
{
    bt_gains gains;
    for (int d = 0; d < 3; d++) {
        gains.force[d] = multiplier(force_nn[d], FORCE_BITS, FORCE_DIVISOR);
    }
    for (int d = 0; d < 2; d++) {
        gains.torque[d] = multiplier(torque_nn[d], TORQUE_BITS, TORQUE_DIVISOR);
    }
    return gains;
}

static int32_t scale(int32_t sum, int32_t gain, int bits)
{
    int32_t scaled = bt_scale(sum, bt_abs32(gain), bits - 32);
    return gain < 0 ? -scaled : scaled;
}

void bt_force(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t force_100un[3])
{
    int32_t sum[3];
    bt_fold_force(e_q4, sum);
    for (int d = 0; d < 3; d++) {
        force_100un[d] = scale(sum[d], gains->force[d], FORCE_BITS);
    }
}

void bt_torque_yz(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t torque_mnmm[2])
{
    bt_split_sums sums;
    bt_fold_torque(e_q4, &sums);
    for (int d = 0; d < 2; d++) {
        // Signals are in 1/16 count and arms in 1/16 um: hi, split off at 2^8, is in count * um.
        int32_t half = 1 << (BT_FOLD_ARM_SPLIT_BITS - 1);
        int32_t sum = bt_join(sums.hi[d + 1], sums.lo[d + 1], BT_FOLD_ARM_SPLIT_BITS, half);
        torque_mnmm[d] = scale(sum, gains->torque[d], TORQUE_BITS);
    }
}

int32_t bt_torque_x_derived(const int32_t poc_yz_um_q4[2], const int32_t force_100un[3])
{
    int32_t mask = (1 << LEVER_SPLIT_BITS) - 1;
    int32_t y = poc_yz_um_q4[0];
    int32_t z = poc_yz_um_q4[1];
    int32_t fy = force_100un[1];
    int32_t fz = force_100un[2];
    int32_t high = y * bt_shift_down(fz, LEVER_SPLIT_BITS) - z * bt_shift_down(fy, LEVER_SPLIT_BITS);
    int32_t low = y * (fz & mask) - z * (fy & mask);
    int32_t lever = bt_join(high, low, LEVER_SPLIT_BITS, 1 << (LEVER_SPLIT_BITS - 1));
    return bt_scale(lever, LEVER_MULTIPLIER, LEVER_BITS - 32);
}
