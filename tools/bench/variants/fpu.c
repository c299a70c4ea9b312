// For a core with an FPU and a long multiply (Cortex-M4F): exact integer sums, of force and torque over
// mirrored pairs, and float32 for the last division and root alone. The PoC is in 1/8 um.
//
// Weights have 30 bits: all of them are exact up to 2047 counts. In a frame beyond, squares are summed
// once more, cut below 2^-29 of the largest; that costs as long again.
#include "variants.h"

#include "fixed_point.h"
#include "mirrored_i64_gen.h"

#include <math.h>

#define RADIUS_UM_Q3 ((float)(8 * BT_CORE_RADIUS_UM))
#define ARM_SHIFT    12 // 1/16 count * nm to 1/16 count * 4096 nm

_Static_assert(BT_SUM_SQUARES_R_MAX_Q8_UM >> 49 == 0, "a moment must have a high word that float holds");
_Static_assert(BT_SUM_ARM_MAX_Q4_NM >> ARM_SHIFT < INT32_MAX, "a shifted torque sum must fit int32");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << FPU_FORCE_BITS) / FPU_FORCE_DIVISOR <= INT32_MAX,
               "a force gain must fit int32");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << FPU_TORQUE_BITS) / FPU_TORQUE_DIVISOR <= INT32_MAX,
               "a torque gain must fit int32");

// The order below is the one that keeps the sums in registers. gcc would move loads to the front, additions
// to the end and sums behind the next branch, and spill.
#if defined(__GNUC__) && !defined(__clang__)
#define IN_ORDER                                                                                             \
    __attribute__((noinline,                                                                                 \
                   optimize("no-schedule-insns", "no-tree-reassoc", "no-tree-sink", "no-code-hoisting")))
#else
#define IN_ORDER
#endif

#define WEIGHT_BITS 30 // a pair of them is added within int32

#define INLINED  static inline __attribute__((always_inline))
#define OUTLINED __attribute__((noinline))

typedef struct {
    int64_t weight;
    int64_t x, y, z; // um
    uint32_t all;    // the weights ORed together
} weight_sums;

INLINED uint32_t weight(int32_t e_q4, int weights)
{
    uint32_t e = (uint32_t)(weights == BT_POC_WEIGHTS_ABS_N2 ? e_q4 : e_q4 & bt_shift_down(e_q4, 31));
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? 0 - e : e * e;
}

// Eq 1's sums over weights cut by `down` bits, pair by pair so that they stay in registers.
INLINED weight_sums sum_up(const int32_t e_q4[BT_ELECTRODES], int weights, int down)
{
    bool squared = weights != BT_POC_WEIGHTS_COMPRESS_N1; // else far from too large
    uint64_t total = 0;
    int64_t x = 0; // from the rearmost electrode on
    int64_t y = 0;
    int64_t z = 0; // downwards
    uint32_t all = 0;
#define PAIR(left, right, x_um, y_um, z_um)                                                                  \
    {                                                                                                        \
        uint32_t a = weight(e_q4[left], weights);                                                            \
        uint32_t b = weight(e_q4[right], weights);                                                           \
        all |= squared ? a | b : 0;                                                                          \
        int32_t even = (int32_t)((a >> down) + (b >> down));                                                 \
        int32_t odd = (int32_t)((b >> down) - (a >> down));                                                  \
        total += (uint32_t)even;                                                                             \
        x += (int64_t)even * (x_um);                                                                         \
        y += (int64_t)odd * (y_um);                                                                          \
        z += (int64_t)even * (z_um);                                                                         \
    }
#define SINGLE(i, x_um, z_um)                                                                                \
    {                                                                                                        \
        uint32_t a = weight(e_q4[i], weights);                                                               \
        all |= squared ? a : 0;                                                                              \
        int32_t even = (int32_t)(a >> down);                                                                 \
        total += (uint32_t)even;                                                                             \
        x += (int64_t)even * (x_um);                                                                         \
        z += (int64_t)even * (z_um);                                                                         \
    }
    MIRRORED_PLACES(PAIR, SINGLE)
#undef PAIR
#undef SINGLE
    int64_t weight_sum = (int64_t)total;
    weight_sums sums = {weight_sum, x - weight_sum * MIRRORED_BEHIND_UM, y, -z, all};
    return sums;
}

// To within 2^-23: hi * 2^32 + lo, with lo signed, so that a small negative number has no large parts.
INLINED float to_float(int64_t value)
{
    int32_t hi = (int32_t)((value + ((int64_t)1 << 31)) >> 32);
    int32_t lo = (int32_t)(uint32_t)value;
    return (float)hi * 4294967296.0F + (float)lo;
}

static int32_t to_whole(float value)
{
    return (int32_t)(value < 0 ? value - 0.5F : value + 0.5F);
}

INLINED bool finish(weight_sums sums, float poc_um_q3[3])
{
    bool tip = sums.x > 0;
    float x = to_float(sums.x);
    float y = to_float(sums.y);
    float z = to_float(sums.z);
    float across = y * y + z * z;
    float scale = RADIUS_UM_Q3 / sqrtf(tip ? across + x * x : across);
    poc_um_q3[0] = tip ? x * scale : x * 8 / to_float(sums.weight);
    poc_um_q3[1] = y * scale;
    poc_um_q3[2] = z * scale;
    return sums.weight != 0; // asked last, and what was divided by 0 is dropped: see IN_ORDER
}

// Once more, for a frame beyond 2047 counts whose weights are squares.
OUTLINED static bool point_of_large(const int32_t e_q4[BT_ELECTRODES], int weights, uint32_t all,
                                    float poc_um_q3[3])
{
    return finish(sum_up(e_q4, weights, 32 - __builtin_clz(all) - WEIGHT_BITS), poc_um_q3);
}

// One copy of the sums for each kind of weights.
INLINED bool point_of(const int32_t e_q4[BT_ELECTRODES], int weights, float poc_um_q3[3])
{
    weight_sums sums = sum_up(e_q4, weights, 0);
    bool has_poc = finish(sums, poc_um_q3);
    return sums.all >> WEIGHT_BITS ? point_of_large(e_q4, weights, sums.all, poc_um_q3) : has_poc;
}

// The point in 1/8 um, not rounded yet.
IN_ORDER static bool point_of_contact(const int32_t e_q4[BT_ELECTRODES], int weights, float poc_um_q3[3])
{
    switch (weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        return point_of(e_q4, BT_POC_WEIGHTS_ABS_N2, poc_um_q3);
    case BT_POC_WEIGHTS_COMPRESS_N2:
        return point_of(e_q4, BT_POC_WEIGHTS_COMPRESS_N2, poc_um_q3);
    default:
        return point_of(e_q4, BT_POC_WEIGHTS_COMPRESS_N1, poc_um_q3);
    }
}

// sum * multiplier / 2^bits, rounded half away from zero.
static inline int32_t scale(int32_t sum, int32_t multiplier, int bits)
{
    int64_t product = (int64_t)sum * multiplier;
    int64_t away = product < 0 ? -1 : 0;
    return (int32_t)((product + ((int64_t)1 << (bits - 1)) + away) >> bits);
}

bool variant_fpu(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                 variant_output *out)
{
    fpu_output *fpu = &out->fpu;
    if (wanted & (VARIANT_FORCE | VARIANT_TORQUE)) {
        int32_t sum[3];
        mirrored_i64_force(e_q4, sum);
        for (int d = 0; d < 3; d++) {
            fpu->force_100un[d] = scale(sum[d], settings->fpu_force[d], FPU_FORCE_BITS);
        }
    }
    if (wanted & VARIANT_TORQUE) {
        int64_t sum[2];
        mirrored_i64_torque(e_q4, sum);
        for (int d = 0; d < 2; d++) {
            int32_t rounded = (int32_t)((sum[d] + (1 << (ARM_SHIFT - 1))) >> ARM_SHIFT);
            fpu->torque_mnmm[d + 1] = scale(rounded, settings->fpu_torque[d], FPU_TORQUE_SHIFT);
        }
    }
    if (!(wanted & (VARIANT_POC | VARIANT_TORQUE))) {
        return true;
    }
    float poc[3];
    if (!point_of_contact(e_q4, settings->poc_weights, poc)) {
        return false;
    }
    for (int d = 0; d < 3; d++) {
        fpu->poc_um_q3[d] = to_whole(poc[d]);
    }
    if (wanted & VARIANT_TORQUE) {
        // 1/8 um * 100 uN is 1/80000 mN*mm
        float lever = poc[1] * (float)fpu->force_100un[2] - poc[2] * (float)fpu->force_100un[1];
        fpu->torque_mnmm[0] = to_whole(lever * (1.0F / 80000));
    }
    return true;
}
