#include "variants.h"

#include "fixed_point.h"
#include "tables_gen.h"

// From a variant's own fields and units to um, mN and mN*mm.
#define READ(from, poc, to_um, force, to_mn, torque, to_mnmm)                                                \
    static void read_##from(const variant_output *out, variant_result *result)                               \
    {                                                                                                        \
        for (int d = 0; d < 3; d++) {                                                                        \
            result->poc_um[d] = (double)out->from.poc[d] to_um;                                              \
            result->force_mn[d] = (double)out->from.force[d] to_mn;                                          \
            result->torque_mnmm[d] = (double)out->from.torque[d] to_mnmm;                                    \
        }                                                                                                    \
    }
READ(real64, poc_mm, *1000, force_n, *1000, torque_nmm, *1000)
READ(gold, poc_nm, / 1000, force_un, / 1000, torque_mnmm, )
READ(f32, poc_mm, *1000, force_n, *1000, torque_nmm, *1000)
READ(mirrored, poc_um, , force_mn, , torque_mnmm, )
READ(fpu, poc_um_q3, / 8, force_100un, / 10, torque_mnmm, )
READ(integer, poc_um, , force_100un, / 10, torque_mnmm, )

const variant variants[VARIANTS] = {
    {"double", variant_double, read_real64, false},
    {"float", variant_f32, read_f32, true},
    {"float mirrored", variant_f32_mirrored, read_mirrored, true},
    {"gold int64", variant_gold, read_gold, true},
    {"shipped", variant_shipped, read_integer, true},
    {"Q15", variant_q15, read_integer, true},
    {"int + FPU", variant_fpu, read_fpu, true},
};

#define MANTISSA_MAX 2047
#define SHIFT_MAX    30

// factor to 12 bits, as a fixed-point library's "scale and shift" has it.
static q15_gain gain_of(double factor)
{
    double size = factor < 0 ? -factor : factor;
    int shift = 0;
    while (shift < SHIFT_MAX && size * 2 <= MANTISSA_MAX) {
        size *= 2;
        shift++;
    }
    int16_t mantissa = (int16_t)(size + 0.5);
    q15_gain gain = {(int16_t)(factor < 0 ? -mantissa : mantissa), (int16_t)shift};
    return gain;
}

void variant_settings_init(variant_settings *settings, int poc_weights, const int32_t force_nn[3],
                           const int32_t torque_nn[2])
{
    settings->poc_weights = poc_weights;
    settings->shipped = (bt_solve_settings){
        .poc_weights = poc_weights,
        .gains = bt_gains_from(force_nn, torque_nn),
    };
    settings->real64.poc_weights = poc_weights;
    for (int d = 0; d < 3; d++) {
        double gain_n = force_nn[d] * 1e-9;
        settings->force_nn[d] = force_nn[d];
        settings->real64.force_gain[d] = gain_n;
        settings->f32_force[d] = (float)gain_n;
        settings->mirrored_force[d] = (float)(gain_n / 16); // 1000 mN/N * 1/16 * 1/1000
        settings->fpu_force[d] =
            (int32_t)bt_div_round(force_nn[d] * ((int64_t)1 << FPU_FORCE_BITS), FPU_FORCE_DIVISOR);
        settings->q15_force[d] = gain_of(gain_n * 1e4 / 8);
    }
    for (int d = 0; d < 2; d++) {
        double gain_n = torque_nn[d] * 1e-9;
        double per_nm = gain_n * 1e3 / 16 * 1e-6; // mN*mm per (1/16 count * nm)
        settings->torque_nn[d] = torque_nn[d];
        settings->real64.torque_gain[d] = gain_n;
        settings->f32_torque[d] = (float)gain_n;
        settings->mirrored_torque[d] = (float)per_nm;
        settings->fpu_torque[d] =
            (int32_t)bt_div_round(torque_nn[d] * ((int64_t)1 << FPU_TORQUE_BITS), FPU_TORQUE_DIVISOR);
        settings->q15_torque[d] = gain_of(per_nm * 2 * Q15_ARM_NM);
    }
}
