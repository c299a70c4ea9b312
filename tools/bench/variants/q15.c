// The textbook's fixed point: signals, weights and geometry as int16 in Q15, each product cut by >> 15,
// 32-bit accumulators, every quotient and root in whole Q15. Here to show what that costs in accuracy:
// a square below 2^15 is 0, so that a contact of fewer than 23 counts has no point at all.
#include "variants.h"

#include "fixed_point.h"
#include "tables_gen.h"

#define RATIO_BITS 11 // 19 weights take 20 bits of 31

// um * 100 uN / 10^4 is mN*mm, as a product with 2^32 / 10^4.
#define LEVER_FACTOR 429497

_Static_assert(-1 >> 1 == -1, "the compiler must shift signed numbers arithmetically");

static int32_t q15_times(int32_t a, int32_t b)
{
    return bt_shift_down(a * b, 15);
}

// One result bit per step, as textbooks have it.
static uint32_t root_of(uint32_t n)
{
    uint32_t root = 0;
    for (uint32_t bit = (uint32_t)1 << 30; bit != 0; bit >>= 2) {
        bool fits = n >= root + bit;
        n -= fits ? root + bit : 0;
        root = (root >> 1) + (fits ? bit : 0);
    }
    return root;
}

static int32_t weight(int32_t e, int weights)
{
    switch (weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        return q15_times(e, e);
    case BT_POC_WEIGHTS_COMPRESS_N2:
        return e < 0 ? q15_times(e, e) : 0;
    default:
        return e < 0 ? -e : 0;
    }
}

static bool point_of_contact(const int16_t e[BT_ELECTRODES], int weights, int16_t poc_um[3])
{
    int32_t total = 0;
    int32_t moment[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t w = weight(e[i], weights);
        total += w;
        for (int d = 0; d < 3; d++) {
            moment[d] += q15_times(w, q15_place[i][d]);
        }
    }
    if (total == 0) {
        return false;
    }
    int32_t c[3];
    for (int d = 0; d < 3; d++) {
        c[d] = moment[d] * (1 << RATIO_BITS) / total * (1 << (15 - RATIO_BITS));
    }
    bool tip = c[0] > 0;
    uint32_t square = 0;
    for (int d = tip ? 0 : 1; d < 3; d++) {
        square += (uint32_t)(c[d] * c[d]);
    }
    int32_t length = (int32_t)root_of(square);
    for (int d = 0; d < 3; d++) {
        bool along = d == 0 && !tip;
        poc_um[d] = (int16_t)(along ? q15_times(c[d], Q15_PLACE_UM) : c[d] * BT_CORE_RADIUS_UM / length);
    }
    return true;
}

static int32_t scale(int32_t sum, q15_gain gain)
{
    return bt_shift_down(sum * gain.mantissa, gain.shift);
}

bool variant_q15(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                 variant_output *out)
{
    integer_output *integer = &out->integer;
    int16_t e[BT_ELECTRODES]; // 1/8 count: 4095 counts then take 15 bits and a sign
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = (int16_t)bt_shift_down(e_q4[i], 1);
    }
    if (wanted & (VARIANT_FORCE | VARIANT_TORQUE)) {
        int32_t sum[3] = {0, 0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            for (int d = 0; d < 3; d++) {
                sum[d] += q15_times(e[i], q15_normal[i][d]);
            }
        }
        for (int d = 0; d < 3; d++) {
            integer->force_100un[d] = scale(sum[d], settings->q15_force[d]);
        }
    }
    if (wanted & VARIANT_TORQUE) {
        int32_t sum[2] = {0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            for (int d = 0; d < 2; d++) {
                sum[d] += q15_times(e[i], q15_arm[i][d]);
            }
        }
        for (int d = 0; d < 2; d++) {
            integer->torque_mnmm[d + 1] = scale(sum[d], settings->q15_torque[d]);
        }
    }
    if (!(wanted & (VARIANT_POC | VARIANT_TORQUE))) {
        return true;
    }
    if (!point_of_contact(e, settings->poc_weights, integer->poc_um)) {
        return false;
    }
    if (wanted & VARIANT_TORQUE) {
        int64_t lever = (int64_t)integer->poc_um[1] * integer->force_100un[2]
                        - (int64_t)integer->poc_um[2] * integer->force_100un[1];
        integer->torque_mnmm[0] = (int32_t)((lever * LEVER_FACTOR) >> 32);
    }
    return true;
}
