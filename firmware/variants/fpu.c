// For a core with an FPU and a long multiply (Cortex-M4F): folded integer sums in int64, and float32
// for the last division and root alone. The PoC is in 1/8 um.
//
// Weights are brought to 27 bits, exact up to 724 counts where they are squares; above, what is cut is
// below 2^-26 of the largest. The sums over them are exact; so are those of force and torque.
#include "variants.h"

#include "fix.h"
#include "fold_i64_gen.h"

#include <math.h>

#define RADIUS_UM_Q3 ((float)(8 * BT_CORE_RADIUS_UM))
#define SUM_SHIFT    13 // brings a moment to 32 bits
#define FORCE_BITS   34 // of bt_gains
#define ARM_SHIFT    12 // 1/16 count * nm to 1/16 count * 4096 nm

_Static_assert(FOLD_I64_MOMENT_MAX >> SUM_SHIFT < INT32_MAX, "a moment must shift down to int32");
// N_z alone is 1116 um times a weight of at least 2^26: what the shift drops is below 2^-23 of it.
_Static_assert((((int64_t)-BT_ELECTRODE_Z_MAX_UM << (FOLD_I64_WEIGHT_BITS - 1)) >> SUM_SHIFT) >> 23 > 0,
               "a shifted moment must keep what a float holds");
_Static_assert(BT_SUM_ARM_MAX_Q4_NM >> ARM_SHIFT < INT32_MAX, "a shifted torque sum must fit int32");
_Static_assert(((int64_t)BT_GAIN_MAX_NN << FPU_TORQUE_BITS) / FPU_TORQUE_DIVISOR <= INT32_MAX,
               "a torque gain must fit int32");

// Loops over the electrodes are worth unrolling where there are registers for it; gcc stops at 16.
#if defined(__GNUC__) && !defined(__clang__)
#define UNROLLED _Pragma("GCC unroll 19")
#else
#define UNROLLED
#endif

// The weights of Eq 1; returns all of them ORed together.
static inline uint32_t weigh(const int32_t e_q4[BT_ELECTRODES], int weights, uint32_t w[BT_ELECTRODES])
{
    uint32_t all = 0;
    if (weights == BT_POC_WEIGHTS_ABS_N2) {
        UNROLLED
        for (int i = 0; i < BT_ELECTRODES; i++) {
            w[i] = (uint32_t)e_q4[i] * (uint32_t)e_q4[i];
            all |= w[i];
        }
    } else {
        bool square = weights == BT_POC_WEIGHTS_COMPRESS_N2;
        UNROLLED
        for (int i = 0; i < BT_ELECTRODES; i++) {
            uint32_t compressed = 0 - (uint32_t)(e_q4[i] & bt_shift_down(e_q4[i], 31));
            w[i] = square ? compressed * compressed : compressed;
            all |= w[i];
        }
    }
    return all;
}

static int32_t to_whole(float value)
{
    return (int32_t)(value < 0 ? value - 0.5F : value + 0.5F);
}

// The point in 1/8 um, not rounded yet.
static bool point_of_contact(const int32_t e_q4[BT_ELECTRODES], int weights, float poc_um_q3[3])
{
    uint32_t w[BT_ELECTRODES];
    int32_t v[BT_ELECTRODES];
    uint32_t all = weigh(e_q4, weights, w);
    if (all == 0) {
        return false;
    }
    int down = 32 - __builtin_clz(all) - FOLD_I64_WEIGHT_BITS;
    if (down > 0) {
        UNROLLED
        for (int i = 0; i < BT_ELECTRODES; i++) {
            v[i] = (int32_t)(w[i] >> down);
        }
    } else {
        UNROLLED
        for (int i = 0; i < BT_ELECTRODES; i++) {
            v[i] = (int32_t)(w[i] << -down);
        }
    }
    int64_t sum[3];
    uint32_t total = fold_i64_moments(v, sum);
    bool tip = sum[0] > 0;
    float n[3];
    for (int d = 0; d < 3; d++) {
        n[d] = (float)(int32_t)(sum[d] >> SUM_SHIFT);
    }
    float across = n[1] * n[1] + n[2] * n[2];
    float scale = RADIUS_UM_Q3 / sqrtf(tip ? across + n[0] * n[0] : across);
    poc_um_q3[0] = tip ? n[0] * scale : n[0] * (8 << SUM_SHIFT) / (float)total;
    poc_um_q3[1] = n[1] * scale;
    poc_um_q3[2] = n[2] * scale;
    return true;
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
        fold_i64_force(e_q4, sum);
        for (int d = 0; d < 3; d++) {
            fpu->force_100un[d] = scale(sum[d], settings->shipped.gains.force[d], FORCE_BITS);
        }
    }
    if (wanted & VARIANT_TORQUE) {
        int64_t sum[2];
        fold_i64_torque(e_q4, sum);
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

void variant_read_fpu(const variant_output *out, variant_result *result)
{
    for (int d = 0; d < 3; d++) {
        result->poc_um[d] = out->fpu.poc_um_q3[d] / 8.0;
        result->force_mn[d] = out->fpu.force_100un[d] / 10.0;
        result->torque_mnmm[d] = out->fpu.torque_mnmm[d];
    }
}
