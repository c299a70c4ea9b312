#include "lin2013.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static const double radius_mm = BT_CORE_RADIUS_UM / 1000.0;

static double weight(double e, int weights)
{
    switch (weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        return fabs(e) * fabs(e); // |e*|^n, n = 2
    case BT_POC_WEIGHTS_COMPRESS_N2:
        return e < 0 ? e * e : 0;
    default:
        return e < 0 ? -e : 0;
    }
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

// Eq 1 and Eq 2.
static void point_of_contact(const double e[BT_ELECTRODES], int weights, lin2013_result *result)
{
    double total = 0;
    double c[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double w = weight(e[i], weights);
        total += w;
        for (int d = 0; d < 3; d++) {
            c[d] += w * (bt_electrode_um[i][d] / 1000.0);
        }
    }
    for (int d = 0; d < 3; d++) {
        result->centroid_mm[d] = total > 0 ? c[d] / total : NAN;
        result->poc_mm[d] = result->centroid_mm[d];
    }
    if (!(total > 0)) {
        return;
    }
    const double *m = result->centroid_mm;
    if (m[0] > 0) {
        double length = sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
        for (int d = 0; d < 3; d++) {
            result->poc_mm[d] = m[d] * radius_mm / length;
        }
    } else {
        double length = sqrt(m[1] * m[1] + m[2] * m[2]);
        result->poc_mm[1] = m[1] * radius_mm / length;
        result->poc_mm[2] = m[2] * radius_mm / length;
    }
}

void lin2013(const double e[BT_ELECTRODES], const lin2013_settings *settings, lin2013_result *result)
{
    memset(result, 0, sizeof *result);
    point_of_contact(e, settings->poc_weights, result);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double r[3];
        double en[3];
        double moment[3];
        for (int d = 0; d < 3; d++) {
            r[d] = bt_electrode_um[i][d] / 1000.0;
            en[d] = e[i] * (bt_normal_milli[i][d] / 1000.0);
            result->force_sum[d] += en[d]; // Eq 3
        }
        cross(r, en, moment);
        for (int d = 0; d < 3; d++) {
            result->torque_sum[d] += moment[d]; // Eq 4
        }
    }
    for (int d = 0; d < 3; d++) {
        result->force_n[d] = settings->force_gain[d] * result->force_sum[d];
    }
    result->torque_nmm[1] = settings->torque_gain[0] * result->torque_sum[1];
    result->torque_nmm[2] = settings->torque_gain[1] * result->torque_sum[2];
    double lever[3];
    cross(result->poc_mm, result->force_n, lever);
    result->torque_nmm[0] = lever[0];
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
