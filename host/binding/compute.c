#include "compute.h"

#include "grip_parts.h"
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

double bt_map_force(const bt_population_column *columns, const int32_t e_q4[BT_ELECTRODES],
                    uint32_t firm_100un, double force_n[3])
{
    double sum[12], gated = 0;
    memcpy(sum, columns[2 * BT_ELECTRODES], sizeof sum);
    for (int i = 0; i < BT_ELECTRODES; i++) { // no branches on the sign, which is the noise's
        const double *column = columns[i + (BT_ELECTRODES & -(e_q4[i] > 0))];
        for (int k = 0; k < 12; k++) {
            sum[k] += e_q4[i] / 16.0 * column[k];
        }
    }
    const double gate_x = sum[10] / sum[9], gate_y = sum[11] / sum[9];
    for (int d = 0; d < 3; d++) {
        force_n[d] = sum[d] + gate_x * sum[3 + d] + gate_y * sum[6 + d];
        gated = fmax(gated, fabs(sum[3 + d]) + fabs(sum[6 + d]));
    }
    return 900 + firm_100un / 100 + (2 + 4e4 / sum[9]) * gated; // of signals, coefficients and gates
}

// A touch by a board's criteria. The board's map is evaluated only where its rounding decides.
static bt_likeness judged(const bt_likeness *touch, const int32_t e_q4[BT_ELECTRODES],
                          const double by_map_n[3], double rounded_100un)
{
    bt_likeness near = *touch, far = *touch;
    double off = 0;
    int32_t force_100un[3];
    for (int d = 0; d < 3; d++) {
        off = fmax(off, fabs(by_map_n[d] * 1e4 - touch->otherwise_100un[d]));
    }
    off = fmin(off, BT_MAP_RESULT_MAX);
    bt_population_judge(&near, (uint32_t)fmax(off - rounded_100un, 0));
    bt_population_judge(&far, (uint32_t)(off + rounded_100un));
    bool decided = near.share == far.share && near.outside == far.outside;
    return decided ? near : bt_population_force(&bt_population, e_q4, force_100un);
}

static void population_force(const bt_population_column *columns, const int32_t e_q4[BT_ELECTRODES],
                             double force[3], uint32_t guess_mn[2])
{
    bt_likeness likeness = bt_population_touch(e_q4);
    if (likeness.share > 0) {
        double rounded_100un = bt_map_force(columns, e_q4, likeness.firm_100un, force);
        likeness = judged(&likeness, e_q4, force, rounded_100un);
    }
    bt_population_guess(likeness.share, likeness.outside, likeness.strength_100un, guess_mn);
    uint32_t part_q8 = likeness.share * likeness.gain >> 8;
    double part = part_q8 / (double)BT_POPULATION_ALL,
           rest = (likeness.gain - part_q8) / (double)BT_POPULATION_ALL;
    for (int d = 0; d < 3; d++) {
        double by_map = part_q8 > 0 ? part * force[d] : 0;
        force[d] = rest * likeness.otherwise_100un[d] / 1e4 + by_map;
    }
}

static void drop(double result[3])
{
    result[0] = result[1] = result[2] = NAN;
}

static void fill_grip(const bt_margin *margin, const uint32_t guess_mn[2], bool whole, bt_computed *result)
{
    double part_n[2], half_n[2];
    grip_parts(result->lin.poc_mm, result->lin.force_n, part_n);
    for (int k = 0; k < 2; k++) {
        double share = margin->share_q8[k] / 256.0;
        half_n[k] = (margin->base_mn[k] + guess_mn[k]) / 1e3 + share * (part_n[0] + part_n[1]);
    }
    if (margin == &bt_population.margin) {
        const double pull_n = fmax(part_n[1] - part_n[0] / 5, 0) * 5 / 8,
                     x_mm = fmax(result->lin.poc_mm[0], 0);
        const double ahead_n = pull_n * x_mm / 4.096, tip_n = part_n[0] * fmin(x_mm / 2.048, 1) * 51 / 256;
        half_n[0] += ahead_n + tip_n + fmax(1.5 - part_n[0] - part_n[1], 0) / 2;
        half_n[1] += ahead_n + pull_n;
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
    const bool by_map = formulas->population != NULL;
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
        const bt_margin *margin = by_map ? &bt_population.margin : &bt_lin_margin;
        lin2013_result *lin = &result->lin;
        // Torque x is made of point and force.
        if (wanted & (BT_QUANTITY_FLAG_POC | BT_QUANTITY_FLAG_TORQUE)) {
            lin2013_point(e, formulas->lin.poc_weights, lin->poc_mm);
        }
        if (!(wanted & (BT_QUANTITY_FLAG_FORCE | BT_QUANTITY_FLAG_TORQUE))) {
            guess_mn[0] = guess_mn[1] = 0;
        } else if (by_map) {
            population_force(formulas->population, e_q4, lin->force_n, guess_mn);
        } else {
            lin2013_force(e, formulas->lin.force_gain, lin->force_n);
            bt_lin_guess(bt_strength_100un(e_q4), guess_mn);
        }
        if (wanted & BT_QUANTITY_FLAG_TORQUE) {
            lin2013_torque(e, formulas->lin.torque_gain, lin->poc_mm, lin->force_n, lin->torque_nmm);
        } else {
            drop(lin->torque_nmm);
        }
        if (!(wanted & BT_QUANTITY_FLAG_POC)) {
            drop(lin->poc_mm);
        }
        if (!(wanted & BT_QUANTITY_FLAG_FORCE)) {
            drop(lin->force_n);
        }
        fill_grip(margin, guess_mn, whole, result); // NaN without a force or a point
    }
    return -1;
}

int bt_compute_frame(const bt_formulas *formulas, const void *counts, const void *tare, void *results)
{
    return bt_compute(formulas, 1, counts, 0, tare, 0, results) < 0;
}
