// A faster kernel, with the converter's own step as the yardstick of errors: the shipped kernel's sums
// and Eq 4, but weights and directions of 16 bits, the root's table without interpolation, and the lever in
// um.
#include "kernels.h"

#include "fixed_point.h"
#include "signal/sums_gen.h"
#include "solve/rsqrt_gen.h"

#define BITS 16

// Weights below 2^16, negative: squares lose all bits below 2^-16 of the largest.
static void weigh(const int32_t e_q4[BT_ELECTRODES], int weights, int32_t weight[BT_ELECTRODES])
{
    uint32_t all = 0;
    BT_UNROLL
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t e =
            (uint32_t)(weights == BT_POC_WEIGHTS_ABS_N2 ? e_q4[i] : e_q4[i] & bt_shift_down(e_q4[i], 31));
        weight[i] = (int32_t)(e * e);
        all |= e * e;
    }
    const int down = bt_bit_length(all) - BITS;
    BT_UNROLL
    for (int i = 0; i < BT_ELECTRODES; i++) {
        weight[i] = -(int32_t)(down > 0 ? (uint32_t)weight[i] >> down : (uint32_t)weight[i] << -down);
    }
}

static bool point_of_contact(const int32_t e_q4[BT_ELECTRODES], int weights, int16_t poc_um[3])
{
    int32_t weight[BT_ELECTRODES];
    bt_linear_sums sums;
    if (weights == BT_POC_WEIGHTS_COMPRESS_N1) {
        bt_sums_linear(e_q4, &sums);
    } else {
        weigh(e_q4, weights, weight);
        bt_sums_linear(weight, &sums);
    }
    if (sums.total == 0) {
        return false;
    }
    const int cut = sums.total >> 14 ? 2 : 0; // quarters always fit
    const int32_t x = (int32_t)(sums.ahead >> cut) - (int32_t)((BT_SUMS_X_UNIT_UM >> cut) * sums.behind);
    const uint32_t size[3] = {x > 0 ? (uint32_t)x : 0, bt_abs32(sums.y) >> cut, sums.z >> cut};
    const int down = bt_bit_length(size[0] | size[1] | size[2]) - (BITS - 1);
    uint32_t component[3], square = 0;
    for (int d = 0; d < 3; d++) {
        component[d] = down > 0 ? size[d] >> down : size[d] << -down;
        square += component[d] * component[d];
    }
    const bool is_short = square < 1u << 30;
    const uint32_t q = is_short ? 4 * square : square;
    const uint16_t *at = bt_root_table + ((q >> BT_ROOT_STEP_BITS) - (1u << (30 - BT_ROOT_STEP_BITS)));
    const uint32_t middle = BT_ROOT_BASE + (((uint32_t)at[0] + at[1]) >> 1); // of the table's step
    const uint32_t scale = (is_short ? 2 * middle : middle) * BT_ROOT_UM_FACTOR >> (BT_ROOT_UM_BITS - 4);
    for (int d = 0; d < 3; d++) {
        poc_um[d] = (int16_t)(component[d] * scale >> 16);
    }
    if (x <= 0) {
        poc_um[0] = (int16_t)-(int32_t)bt_div_round_u32(bt_abs32(x), sums.total >> cut);
    }
    poc_um[1] = (int16_t)bt_with_sign((uint32_t)poc_um[1], sums.y);
    poc_um[2] = (int16_t)-poc_um[2];
    return true;
}

bool kernel_quick(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings, uint32_t wanted,
                  kernel_output *out)
{
    (void)wanted;
    int16_t *poc_um = out->integer.poc_um;
    int32_t *force = out->integer.force_100un;
    bt_force(e_q4, &settings->shipped.gains, force);
    bt_torque_yz(e_q4, &settings->shipped.gains, out->integer.torque_mnmm + 1);
    if (!point_of_contact(e_q4, settings->shipped.poc_weights, poc_um)) {
        return false;
    }
    const int32_t lever = poc_um[1] * bt_shift_down(force[2], 4) - poc_um[2] * bt_shift_down(force[1], 4);
    out->integer.torque_mnmm[0] =
        bt_shift_down(bt_shift_down(lever, 9) * 13, 4); // 13/16 of 512 are 1000 / 1.6
    return true;
}
