#include "lin2013.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static const double radius_mm = BT_CORE_RADIUS_UM / 1000.0;

// |e*|^n, of all electrodes or of the compressed ones. No branch on the sign, which is random in noise.
static double weight(double e, int weights)
{
    double size = weights == BT_POC_WEIGHTS_ABS_N2 ? e : (fabs(e) - e) / 2;
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? size : size * size;
}

void lin2013_point(const double e[BT_ELECTRODES], int weights, double poc_mm[3])
{
    double total = 0;
    double c[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double w = weight(e[i], weights);
        total += w;
        for (int d = 0; d < 3; d++) {
            c[d] += w * bt_electrode_um[i][d];
        }
    }
    double tip_x = c[0] > 0 ? c[0] : 0; // on the cylinder, x is no part of the length
    double to_surface = radius_mm / sqrt(tip_x * tip_x + c[1] * c[1] + c[2] * c[2]);
    poc_mm[0] = c[0] > 0 ? c[0] * to_surface : c[0] / (total * 1000);
    poc_mm[1] = c[1] * to_surface;
    poc_mm[2] = c[2] * to_surface;
}

void lin2013_force(const double e[BT_ELECTRODES], const double gain[3], double force_n[3])
{
    double sum[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int d = 0; d < 3; d++) {
            sum[d] += e[i] * bt_normal_milli[i][d];
        }
    }
    for (int d = 0; d < 3; d++) {
        force_n[d] = gain[d] / 1e3 * sum[d];
    }
}

void lin2013_torque(const double e[BT_ELECTRODES], const double gain[2], const double poc_mm[3],
                    const double force_n[3], double torque_nmm[3])
{
    double sum[2] = {0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int d = 0; d < 2; d++) {
            sum[d] += e[i] * bt_arm_nm[i][1 + d];
        }
    }
    torque_nmm[0] = poc_mm[1] * force_n[2] - poc_mm[2] * force_n[1];
    for (int d = 0; d < 2; d++) {
        torque_nmm[1 + d] = gain[d] / 1e6 * sum[d];
    }
}

void lin2013(const double e[BT_ELECTRODES], const lin2013_settings *settings, lin2013_result *result)
{
    lin2013_point(e, settings->poc_weights, result->poc_mm);
    lin2013_force(e, settings->force_gain, result->force_n);
    lin2013_torque(e, settings->torque_gain, result->poc_mm, result->force_n, result->torque_nmm);
}

void lin2013_frames(int64_t n, const uint16_t *counts, const uint16_t *tare_q4,
                    const lin2013_settings *settings, double *poc_mm, double *force_n, double *torque_nmm)
{
    for (int64_t k = 0; k < n; k++) {
        double e[BT_ELECTRODES];
        lin2013_result result;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            uint16_t count = counts[k * BT_ELECTRODES + i];
            uint16_t tare = tare_q4[k * BT_ELECTRODES + i];
            bool missing = count == BT_INVALID_COUNT || tare == BT_INVALID_COUNT;
            e[i] = missing ? 0 : count - tare / 16.0;
        }
        lin2013(e, settings, &result);
        memcpy(poc_mm + 3 * k, result.poc_mm, sizeof result.poc_mm);
        memcpy(force_n + 3 * k, result.force_n, sizeof result.force_n);
        memcpy(torque_nmm + 3 * k, result.torque_nmm, sizeof result.torque_nmm);
    }
}
