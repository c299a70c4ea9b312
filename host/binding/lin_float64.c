#include "lin_float64.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

void bt_lin_plan_init(bt_lin_plan *plan, const lin2013_settings *settings, const double *population)
{
    memset(plan, 0, sizeof *plan);
    plan->population = (const double (*)[3])population;
    plan->poc_weights = settings->poc_weights;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        plan->of_weight[i][0] = 1;
        for (int d = 0; d < 3; d++) {
            plan->of_weight[i][1 + d] = bt_electrode_um[i][d];
            plan->of_signal[i][d] = bt_normal_milli[i][d];
        }
        plan->of_signal[i][3] = bt_arm_nm[i][1];
        plan->of_signal[i][4] = bt_arm_nm[i][2];
    }
    for (int d = 0; d < 3; d++) {
        plan->force_scale[d] = settings->force_gain[d] / (16 * 1000);
    }
    for (int d = 0; d < 2; d++) {
        plan->torque_scale[d] = settings->torque_gain[d] / (16 * 1e6);
    }
}

// A tare in 1/16 count; false if a value is out of range.
static bool tare_row(const uint8_t *row, int32_t tare_q4[BT_ELECTRODES])
{
    double count[BT_ELECTRODES];
    bool good = true;
    memcpy(count, row, sizeof count);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool inside = count[i] >= 0 && count[i] <= BT_FULL_SCALE_COUNT; // a NaN is not
        good &= inside;
        tare_q4[i] = (int32_t)((inside ? count[i] : 0) * 16 + 0.5);
    }
    return good;
}

// e = count - tare in 1/16 count, 0 for a missing electrode; false if a count is out of range.
static bool signals_of(const uint16_t counts[BT_ELECTRODES], const int32_t tare_q4[BT_ELECTRODES],
                       int32_t e_q4[BT_ELECTRODES])
{
    int32_t seen = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool missing = counts[i] == BT_INVALID_COUNT;
        seen |= missing ? 0 : counts[i];
        e_q4[i] = missing ? 0 : 16 * counts[i] - tare_q4[i];
    }
    return seen <= BT_FULL_SCALE_COUNT;
}

// Of Eq 1. A branch on the sign of noise would take longer than all the sums.
static inline double weight(int32_t e_q4, int weights)
{
    int32_t compression = -e_q4 & -(e_q4 < 0);
    double size = weights == BT_POC_WEIGHTS_ABS_N2 ? e_q4 : compression;
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? size : size * size;
}

static void frame(const bt_lin_plan *plan, const int32_t e_q4[BT_ELECTRODES], double *results)
{
    double weighted[4] = {0}, summed[5] = {0};
    double *poc = results, *force = results + 3, *torque = results + 6;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double e = e_q4[i], w = weight(e_q4[i], plan->poc_weights);
        for (int d = 0; d < 4; d++) {
            weighted[d] += w * plan->of_weight[i][d];
        }
        for (int d = 0; d < 5; d++) {
            summed[d] += e * plan->of_signal[i][d];
        }
    }
    // Eq 2. With no weight at all 0/0 makes the PoC and the lever NaN.
    double x = weighted[1], y = weighted[2], z = weighted[3];
    double tip_x = x > 0 ? x : 0; // no part of the length on the cylinder
    double to_surface = BT_CORE_RADIUS_UM / 1000.0 / sqrt(tip_x * tip_x + y * y + z * z);
    poc[0] = x > 0 ? x * to_surface : x / (weighted[0] * 1000);
    poc[1] = y * to_surface;
    poc[2] = z * to_surface;
    for (int d = 0; d < 3; d++) {
        force[d] = summed[d] * plan->force_scale[d];
    }
    torque[0] = poc[1] * force[2] - poc[2] * force[1];
    torque[1] = summed[3] * plan->torque_scale[0];
    torque[2] = summed[4] * plan->torque_scale[1];
}

int64_t bt_lin_frames(const bt_lin_plan *plan, int64_t n, const void *counts, int64_t counts_stride,
                      const void *tare, int64_t tare_stride, void *results)
{
    int32_t tare_q4[BT_ELECTRODES];
    if (tare_stride == 0 && !tare_row(tare, tare_q4)) {
        return 0;
    }
    for (int64_t k = 0; k < n; k++) {
        uint16_t row[BT_ELECTRODES];
        int32_t e_q4[BT_ELECTRODES];
        double *out = (double *)results + BT_RESULTS * k;
        memcpy(row, (const uint8_t *)counts + k * counts_stride, sizeof row);
        if ((tare_stride != 0 && !tare_row((const uint8_t *)tare + k * tare_stride, tare_q4))
            || !signals_of(row, tare_q4, e_q4)) {
            return k;
        }
        frame(plan, e_q4, out);
        if (plan->population != NULL) {
            bt_population_replace(plan->population, e_q4, out);
        }
    }
    return -1;
}

int bt_one_frame(const bt_lin_plan *plan, const void *counts, const void *tare, void *results)
{
    return bt_lin_frames(plan, 1, counts, 0, tare, 0, results) < 0;
}
