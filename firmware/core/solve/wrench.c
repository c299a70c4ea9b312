#include "solve/wrench.h"

#include "fixed_point.h"
#include "map/map_gen.h"
#include "signal/sums_gen.h"

// sum * gain / FORCE_DIVISOR is 100 uN: 1/16 count * 1/1000 * nN. sum * gain / TORQUE_DIVISOR is mN*mm: 1/16
// count * BT_SUMS_TORQUE_UNIT_NM * nN. Multiplying by 2^bits / divisor and shifting replaces both divisions.
#define FORCE_DIVISOR  1600000000LL
#define FORCE_BITS     34
#define TORQUE_BITS    35
#define TORQUE_DIVISOR (16LL * 1000000000000LL / BT_SUMS_TORQUE_UNIT_NM)

// The lever: 10 mm / 2^17 * 100 uN is 2^-17 mN*mm; products are split at 13 bits.
#define LEVER_BITS       17
#define LEVER_SPLIT_BITS 13
#define LEVER_MAX        (((int64_t)BT_CORE_RADIUS_UM << LEVER_BITS) / 10000 + 2)

#define FORCE_MAX_100UN (BT_SUM_NORMAL_MAX_Q4_MILLI * BT_GAIN_MAX_NN / FORCE_DIVISOR + 1)

// The bounds below assume that all gains have one range, symmetric about 0.
#define HAS_GAIN_RANGE(name)                                                                                 \
    (BT_SETTING_##name##_MAX == BT_GAIN_MAX_NN && BT_SETTING_##name##_MIN == -BT_GAIN_MAX_NN)
_Static_assert(HAS_GAIN_RANGE(FORCE_GAIN_X_NN) && HAS_GAIN_RANGE(FORCE_GAIN_Y_NN)
                   && HAS_GAIN_RANGE(FORCE_GAIN_Z_NN),
               "the force gains must have one range");
_Static_assert(HAS_GAIN_RANGE(TORQUE_GAIN_Y_NN) && HAS_GAIN_RANGE(TORQUE_GAIN_Z_NN),
               "the torque gains must have the force gains' range");

_Static_assert(BT_SUM_NORMAL_MAX_Q4_MILLI <= INT32_MAX, "a force sum must fit int32");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << FORCE_BITS) / FORCE_DIVISOR <= 1 << 30,
               "a force gain must fit bt_scale");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << TORQUE_BITS) / TORQUE_DIVISOR <= 1 << 30,
               "a torque gain must fit bt_scale");
_Static_assert(0x7FFFLL * 0xFFFF + 0xFFFFLL * (1 << 14) + 0xFFFF <= UINT32_MAX,
               "the middle products of bt_scale must fit uint32");
_Static_assert(BT_SUM_ARM_MAX_Q4_NM / BT_SUMS_TORQUE_UNIT_NM + 2 + BT_ELECTRODES * (int64_t)BT_E_MAX_Q4
                   <= INT32_MAX,
               "a torque sum must fit int32, even with arms rounded to whole units");
_Static_assert((int64_t)BT_E_MAX_Q4 *(BT_SUMS_LINE_PARTS_MAX + BT_ELECTRODES) <= INT32_MAX
                   && (int64_t)BT_E_MAX_Q4 * BT_ELECTRODES << (BT_SUMS_ARM_BITS - 1) <= INT32_MAX,
               "a torque sum's fractions must fit int32");
_Static_assert(2 * LEVER_MAX * ((FORCE_MAX_100UN >> LEVER_SPLIT_BITS) + 2) < INT32_MAX,
               "the lever's high products and what the low ones add to them must fit int32");
_Static_assert(BT_MAP_RESULT_MAX <= FORCE_MAX_100UN,
               "a map's force must not be more than the gains can make");
_Static_assert(2 * LEVER_MAX << LEVER_SPLIT_BITS < INT32_MAX, "the lever's low products must fit int32");

static bt_gain multiplier(int32_t gain_nn, int bits, int64_t divisor)
{
    int32_t rounded = (int32_t)bt_div_round(gain_nn * ((int64_t)1 << bits), divisor);
    uint32_t magnitude = bt_abs32(rounded);
    bt_gain gain = {(uint16_t)(magnitude >> 16), (uint16_t)magnitude, bt_shift_down(rounded, 31)};
    return gain;
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

static int32_t scale(int32_t sum, const bt_gain *gain, int bits)
{
    return bt_with_sign(bt_scale(bt_abs32(sum), gain->high, gain->low, bits - 32), sum ^ gain->sign);
}

static inline void force_from(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int first,
                              int32_t force_100un[3])
{
    int32_t sum[3];
    bt_sums_force(e_q4, sum);
    for (int d = first; d < 3; d++) {
        force_100un[d] = scale(sum[d], &gains->force[d], FORCE_BITS);
    }
}

void bt_force(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t force_100un[3])
{
    force_from(e_q4, gains, 0, force_100un);
}

void bt_force_yz(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t force_100un[3])
{
    force_from(e_q4, gains, 1, force_100un);
}

void bt_torque_yz(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t torque_mnmm[2])
{
    int32_t sum[2];
    bt_sums_torque(e_q4, sum);
    for (int d = 0; d < 2; d++) {
        torque_mnmm[d] = scale(sum[d], &gains->torque[d], TORQUE_BITS);
    }
}

int32_t bt_torque_x_derived(const int32_t lever_yz[2], const int32_t force_100un[3])
{
    int32_t split = 1 << LEVER_SPLIT_BITS;
    int32_t y = lever_yz[0];
    int32_t z = lever_yz[1];
    int32_t fy_high = force_100un[1] / split; // towards 0, so that mirrored signals give mirrored torques
    int32_t fz_high = force_100un[2] / split;
    int32_t fy_low = force_100un[1] - fy_high * split;
    int32_t fz_low = force_100un[2] - fz_high * split;
    int32_t lever = y * fz_high - z * fy_high + (y * fz_low - z * fy_low) / split;
    uint32_t half = 1u << (LEVER_BITS - LEVER_SPLIT_BITS - 1);
    return bt_with_sign((bt_abs32(lever) + half) >> (LEVER_BITS - LEVER_SPLIT_BITS), lever);
}
