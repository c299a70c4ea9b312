#include "compute.h"

#include "grip_parts.h"
#include "map/map_gen.h"
#include "map/population.h"
#include "solve/interval.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

// A tare in 1/16 count; false if a value is out of range.
static bool read_tare(const uint8_t *row, int32_t tare_q4[BT_ELECTRODES])
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

// Signals in 1/16 count, 0 for a missing electrode; false if a count is out of range. *whole: none is
// missing.
static bool read_signals(const uint8_t *row, const int32_t tare_q4[BT_ELECTRODES],
                         int32_t e_q4[BT_ELECTRODES], bool *whole)
{
    uint16_t count[BT_ELECTRODES];
    int32_t seen = 0;
    *whole = true;
    memcpy(count, row, sizeof count);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool missing = count[i] == BT_INVALID_COUNT;
        seen |= missing ? 0 : count[i];
        *whole &= !missing;
        e_q4[i] = missing ? 0 : 16 * count[i] - tare_q4[i];
    }
    return seen <= BT_FULL_SCALE_COUNT;
}

// The compression's centroid over its reaches, along the finger and across. The sums are whole, so that the
// sign of noise makes no branch, which would take longer than all of them.
static void compute_gates(const int32_t e_q4[BT_ELECTRODES], double *x, double *y)
{
    int64_t weight = 0, along = 0, across = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t w = BT_MAP_FLOOR_Q4 - (e_q4[i] & -(e_q4[i] < 0));
        weight += w;
        along += (int64_t)w * bt_electrode_um[i][0];
        across += (int64_t)w * bt_electrode_um[i][1];
    }
    *x = (double)along / (double)weight / BT_MAP_REACH_X_UM;
    *y = (double)across / (double)weight / BT_MAP_REACH_Y_UM;
}

// Lin's force becomes the population map's, and torque x what follows.
static void replace_force(const bt_population_column *columns, const int32_t e_q4[BT_ELECTRODES],
                          const double e[BT_ELECTRODES], lin2013_result *result, uint32_t guess_mn[2])
{
    double gate_x, gate_y, sum[9] = {0};
    int32_t force_100un[3];
    bt_likeness likeness = bt_population_force(e_q4, force_100un);
    bt_population_guess(likeness.share, likeness.outside, likeness.strength_100un, guess_mn);
    uint32_t part_q8 = likeness.share * likeness.gain >> 8;
    double part = part_q8 / (double)BT_POPULATION_ALL,
           rest = (likeness.gain - part_q8) / (double)BT_POPULATION_ALL;
    double *force = result->force_n;
    compute_gates(e_q4, &gate_x, &gate_y);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        const double *column = columns[i + (BT_ELECTRODES & -(e_q4[i] > 0))];
        for (int k = 0; k < 9; k++) {
            sum[k] += e[i] * column[k];
        }
    }
    for (int d = 0; d < 3; d++) {
        double by_map = sum[d] + gate_x * sum[3 + d] + gate_y * sum[6 + d];
        force[d] = part * by_map + rest * likeness.otherwise_100un[d] / 1e4;
    }
    result->torque_nmm[0] = result->poc_mm[1] * force[2] - result->poc_mm[2] * force[1];
}

static void drop(const uint32_t wanted, const uint32_t quantity, double result[3])
{
    for (int d = 0; d < 3 && !(wanted & quantity); d++) {
        result[d] = NAN;
    }
}

static void fill_grip(const bt_margin *margin, const uint32_t guess_mn[2], bool whole, bt_computed *result)
{
    double part_n[2], half_n[2];
    grip_parts(result->lin.poc_mm, result->lin.force_n, part_n);
    for (int k = 0; k < 2; k++) {
        double share = margin->share_q8[k] / 256.0;
        half_n[k] = (margin->base_mn[k] + guess_mn[k]) / 1e3 + share * (part_n[0] + part_n[1]);
    }
    result->normal_n = part_n[0];
    result->shear_n = part_n[1];
    result->normal_half_n = whole ? half_n[0] : NAN;
    result->shear_half_n = whole ? half_n[1] : NAN;
}

int64_t bt_compute(const bt_formulas *formulas, int64_t n, const void *counts, int64_t counts_stride,
                   const void *tare, int64_t tare_stride, void *results)
{
    int32_t tare_q4[BT_ELECTRODES], e_q4[BT_ELECTRODES];
    double e[BT_ELECTRODES];
    bt_computed *result = results;
    const uint32_t wanted = formulas->wanted;
    if (tare_stride == 0 && !read_tare(tare, tare_q4)) {
        return 0;
    }
    for (int64_t k = 0; k < n; k++, result++) {
        uint32_t guess_mn[2];
        bool whole;
        if ((tare_stride != 0 && !read_tare((const uint8_t *)tare + k * tare_stride, tare_q4))
            || !read_signals((const uint8_t *)counts + k * counts_stride, tare_q4, e_q4, &whole)) {
            return k;
        }
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = e_q4[i] / 16.0;
        }
        const bt_margin *margin = &bt_lin_margin;
        lin2013(e, &formulas->lin, &result->lin);
        // Torque x is made of the map's force.
        if (formulas->population != NULL && wanted & (BT_QUANTITY_FLAG_FORCE | BT_QUANTITY_FLAG_TORQUE)) {
            replace_force(formulas->population, e_q4, e, &result->lin, guess_mn);
            margin = &bt_population.margin;
        } else {
            bt_lin_guess(bt_strength_100un(e_q4), guess_mn);
        }
        drop(wanted, BT_QUANTITY_FLAG_POC, result->lin.poc_mm);
        drop(wanted, BT_QUANTITY_FLAG_FORCE, result->lin.force_n);
        drop(wanted, BT_QUANTITY_FLAG_TORQUE, result->lin.torque_nmm);
        fill_grip(margin, guess_mn, whole, result); // NaN without a force or a point
    }
    return -1;
}

int bt_compute_frame(const bt_formulas *formulas, const void *counts, const void *tare, void *results)
{
    return bt_compute(formulas, 1, counts, 0, tare, 0, results) < 0;
}
