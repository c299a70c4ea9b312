// float32 sums over mirrored pairs of electrodes, and Eq 1 and 2 fused: no division by the weight sum on
// the tip, and each coefficient is a whole number that float32 holds exactly.
#include "variants.h"

#include "mirrored_f32_gen.h"

#include <math.h>

#define RADIUS_UM ((float)BT_CORE_RADIUS_UM)

static bool point_of_contact(const float e[BT_ELECTRODES], int weights, float poc_um[3])
{
    float w[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        float compressed = e[i] < 0 ? -e[i] : 0;
        float base = weights == BT_POC_WEIGHTS_ABS_N2 ? e[i] : compressed;
        w[i] = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? base : base * base;
    }
    float sum[3];
    float total = mirrored_f32_moments(w, sum);
    if (!(total > 0)) {
        return false;
    }
    bool tip = sum[0] > 0;
    float across = sum[1] * sum[1] + sum[2] * sum[2];
    float scale = RADIUS_UM / sqrtf(tip ? across + sum[0] * sum[0] : across);
    poc_um[0] = tip ? sum[0] * scale : sum[0] / total;
    poc_um[1] = sum[1] * scale;
    poc_um[2] = sum[2] * scale;
    return true;
}

bool variant_f32_mirrored(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings,
                          unsigned wanted, variant_output *out)
{
    mirrored_output *mirrored = &out->mirrored;
    float e[BT_ELECTRODES]; // in 1/16 count: exact, and the gains know
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = (float)e_q4[i];
    }
    if (wanted & (VARIANT_FORCE | VARIANT_TORQUE)) {
        float sum[3];
        mirrored_f32_force(e, sum);
        for (int d = 0; d < 3; d++) {
            mirrored->force_mn[d] = settings->mirrored_force[d] * sum[d];
        }
    }
    if (wanted & VARIANT_TORQUE) {
        float sum[2];
        mirrored_f32_torque(e, sum);
        for (int d = 0; d < 2; d++) {
            mirrored->torque_mnmm[d + 1] = settings->mirrored_torque[d] * sum[d];
        }
    }
    if (!(wanted & (VARIANT_POC | VARIANT_TORQUE))) {
        return true;
    }
    if (!point_of_contact(e, settings->poc_weights, mirrored->poc_um)) {
        return false;
    }
    if (wanted & VARIANT_TORQUE) {
        const float *force = mirrored->force_mn;
        mirrored->torque_mnmm[0] = (mirrored->poc_um[1] * force[2] - mirrored->poc_um[2] * force[1]) * 1e-3F;
    }
    return true;
}
