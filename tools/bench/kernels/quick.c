// The quick and worse one, of the shipped kernel's own sums: lengths are a largest component and three
// eighths of the others, up to 7 % off, squares lose their lower half, so that with n = 2 a contact of fewer
// than 16 counts has no point at all, and all of the torque is the lever of the point, which is not what Eq 4
// adds up.
#include "kernels.h"

#include "fixed_point.h"
#include "solve/sums_gen.h"

#define COMPONENT_BITS 15

static uint32_t length_of(uint32_t a, uint32_t b)
{
    return a > b ? a + 3 * b / 8 : b + 3 * a / 8;
}

static bool point_of_contact(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings,
                             int16_t poc_um[3])
{
    const int weights = settings->shipped.poc_weights;
    int32_t weight[BT_ELECTRODES]; // negative
    bt_linear_sums sums;
    BT_UNROLL
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t e = weights == BT_POC_WEIGHTS_ABS_N2 ? e_q4[i] : e_q4[i] & bt_shift_down(e_q4[i], 31);
        weight[i] = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? e : -(int32_t)((uint32_t)e * (uint32_t)e >> 16);
    }
    bt_sums_linear(weight, &sums);
    if (sums.total == 0) {
        return false;
    }
    // Quarters, which fit in a signed number.
    const int32_t x = (int32_t)(sums.ahead >> 2) - (int32_t)(BT_SUMS_X_UNIT_UM / 4 * sums.behind);
    const bool tip = x > 0;
    const uint32_t size[3] = {tip ? (uint32_t)x : 0, bt_abs32(sums.y) >> 2, sums.z >> 2};
    const int down = bt_bit_length(size[0] | size[1] | size[2]) - COMPONENT_BITS;
    uint32_t component[3];
    for (int d = 0; d < 3; d++) {
        component[d] = down > 0 ? size[d] >> down : size[d] << -down;
    }
    const uint32_t length = length_of(length_of(component[1], component[2]), component[0]);
    const uint32_t scale = ((uint32_t)BT_CORE_RADIUS_UM << COMPONENT_BITS) / length;
    poc_um[0] = (int16_t)(tip ? (int32_t)(component[0] * scale >> COMPONENT_BITS)
                              : -(int32_t)(4 * (bt_abs32(x) / sums.total)));
    poc_um[1] = (int16_t)bt_with_sign(component[1] * scale >> COMPONENT_BITS, sums.y);
    poc_um[2] = (int16_t)-(int32_t)(component[2] * scale >> COMPONENT_BITS);
    return true;
}

bool kernel_quick(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings, uint32_t wanted,
                  kernel_output *out)
{
    (void)wanted;
    int32_t force[3];
    int16_t *poc_um = out->integer.poc_um;
    bt_force(e_q4, &settings->shipped.gains, out->integer.force_100un);
    if (!point_of_contact(e_q4, settings, poc_um)) {
        return false;
    }
    for (int d = 0; d < 3; d++) {
        force[d] = bt_shift_down(out->integer.force_100un[d], 4); // in 1.6 mN
    }
    for (int d = 0; d < 3; d++) {
        const int a = (d + 1) % 3, b = (d + 2) % 3;
        const int32_t lever = poc_um[a] * force[b] - poc_um[b] * force[a];
        out->integer.torque_mnmm[d] =
            bt_shift_down(bt_shift_down(lever, 9) * 13, 4); // 13/16 of 512 are 1000 / 1.6
    }
    return true;
}
