// float32 in the paper's order: firmware/reference/lin2013.c with float for double, and Table 1 in mm
// instead of a division of its integers in every frame.
#include "variants.h"

#include "tables_gen.h"

#include <math.h>

static float weight(float e, int weights)
{
    switch (weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        return e * e;
    case BT_POC_WEIGHTS_COMPRESS_N2:
        return e < 0 ? e * e : 0;
    default:
        return e < 0 ? -e : 0;
    }
}

static bool point_of_contact(const float e[BT_ELECTRODES], int weights, float poc_mm[3])
{
    const float radius_mm = BT_CORE_RADIUS_UM / 1000.0F;
    float total = 0;
    float c[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        float w = weight(e[i], weights);
        total += w;
        for (int d = 0; d < 3; d++) {
            c[d] += w * f32_place_mm[i][d];
        }
    }
    if (!(total > 0)) {
        return false;
    }
    for (int d = 0; d < 3; d++) {
        c[d] /= total;
    }
    bool tip = c[0] > 0;
    float length = sqrtf((tip ? c[0] * c[0] : 0) + c[1] * c[1] + c[2] * c[2]);
    poc_mm[0] = tip ? c[0] * radius_mm / length : c[0];
    poc_mm[1] = c[1] * radius_mm / length;
    poc_mm[2] = c[2] * radius_mm / length;
    return true;
}

bool variant_f32(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                 variant_output *out)
{
    f32_output *f32 = &out->f32;
    float e[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = (float)e_q4[i] / 16.0F;
    }
    if (wanted & (VARIANT_FORCE | VARIANT_TORQUE)) {
        float sum[3] = {0, 0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            for (int d = 0; d < 3; d++) {
                sum[d] += e[i] * f32_normal[i][d];
            }
        }
        for (int d = 0; d < 3; d++) {
            f32->force_n[d] = settings->f32_force[d] * sum[d];
        }
    }
    if (wanted & VARIANT_TORQUE) {
        float sum[2] = {0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            for (int d = 0; d < 2; d++) {
                sum[d] += e[i] * f32_arm_mm[i][d];
            }
        }
        for (int d = 0; d < 2; d++) {
            f32->torque_nmm[d + 1] = settings->f32_torque[d] * sum[d];
        }
    }
    if (!(wanted & (VARIANT_POC | VARIANT_TORQUE))) {
        return true;
    }
    if (!point_of_contact(e, settings->poc_weights, f32->poc_mm)) {
        return false;
    }
    if (wanted & VARIANT_TORQUE) {
        f32->torque_nmm[0] = f32->poc_mm[1] * f32->force_n[2] - f32->poc_mm[2] * f32->force_n[1];
    }
    return true;
}
