// float32 in the paper's order: firmware/reference/lin2013.c with float for double, and Table 1 in mm instead
// of a division of the integers in every frame.
#include "kernels.h"

#include <math.h>

static float weight(float e, int weights)
{
    if (weights == BT_POC_WEIGHTS_ABS_N2) {
        return e * e;
    }
    float compressed = e < 0 ? -e : 0;
    return weights == BT_POC_WEIGHTS_COMPRESS_N2 ? compressed * compressed : compressed;
}

static bool point_of_contact(const float e[BT_ELECTRODES], const kernel_settings *settings, float poc_mm[3])
{
    const float radius_mm = BT_CORE_RADIUS_UM / 1000.0F;
    float total = 0;
    float c[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        float w = weight(e[i], settings->shipped.poc_weights);
        total += w;
        for (int d = 0; d < 3; d++) {
            c[d] += w * settings->f32_place_mm[i][d];
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

bool kernel_float(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings, uint32_t wanted,
                  kernel_output *out)
{
    (void)wanted;
    float e[BT_ELECTRODES];
    float sum[5] = {0, 0, 0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = (float)e_q4[i] / 16.0F;
        for (int d = 0; d < 3; d++) {
            sum[d] += e[i] * settings->f32_normal[i][d];
        }
        for (int d = 0; d < 2; d++) {
            sum[3 + d] += e[i] * settings->f32_arm_mm[i][d];
        }
    }
    for (int d = 0; d < 3; d++) {
        out->f32.force_n[d] = settings->f32_force[d] * sum[d];
    }
    for (int d = 0; d < 2; d++) {
        out->f32.torque_nmm[d + 1] = settings->f32_torque[d] * sum[3 + d];
    }
    if (!point_of_contact(e, settings, out->f32.poc_mm)) {
        return false;
    }
    out->f32.torque_nmm[0] =
        out->f32.poc_mm[1] * out->f32.force_n[2] - out->f32.poc_mm[2] * out->f32.force_n[1];
    return true;
}
