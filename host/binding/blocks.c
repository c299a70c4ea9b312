#include "blocks.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define BLOCK 16 // frames: 8 and 64 measured slower, 32 no faster

// The block's loops are compiled twice, for sixteen frames and for one: with the width a variable
// they would not be unrolled into vectors.
#if defined(__GNUC__)
#define SPECIALISED static inline __attribute__((always_inline))
#else
#define SPECIALISED static inline
#endif

_Static_assert(2 * BT_MIRRORED + BT_MIDLINE == BT_ELECTRODES, "every electrode has its place");
_Static_assert(BT_MIRRORED + BT_MIDLINE == BT_FOLDED, "the folded rows are pairs and midline");

// E8 and E9 mirror each other, E1..E6 and E11..E16 do. The tests compare this with the generated
// geometry.
static const int left_of[BT_MIRRORED] = {0, 1, 2, 3, 4, 5, 7};
static const int right_of[BT_MIRRORED] = {10, 11, 12, 13, 14, 15, 8};
static const int midline[BT_MIDLINE] = {6, 9, 16, 17, 18};

// One row per electrode, pair or result, one column per frame: [row * width + frame].
typedef struct {
    int32_t even[BT_FOLDED * BLOCK];    // e of the right one + e of the left one, q4
    int32_t odd[BT_MIRRORED * BLOCK];   // e of the right one - e of the left one, q4
    double w_even[BT_FOLDED * BLOCK];   // the same of the weights, negated
    double w_odd[BT_MIRRORED * BLOCK];
} folded;

void bt_block_plan_init(bt_block_plan *plan, const lin2013_settings *settings)
{
    plan->poc_weights = settings->poc_weights;
    for (int p = 0; p < BT_FOLDED; p++) {
        int i = p < BT_MIRRORED ? right_of[p] : midline[p - BT_MIRRORED];
        plan->x_um[p] = bt_electrode_um[i][0];
        plan->z_um[p] = bt_electrode_um[i][2];
        plan->normal_x[p] = bt_normal_milli[i][0];
        plan->normal_z[p] = bt_normal_milli[i][2];
        plan->arm_y_nm[p] = bt_arm_nm[i][1];
        if (p < BT_MIRRORED) {
            plan->y_um[p] = bt_electrode_um[i][1];
            plan->normal_y[p] = bt_normal_milli[i][1];
            plan->arm_z_nm[p] = bt_arm_nm[i][2];
        }
    }
    for (int d = 0; d < 3; d++) {
        plan->force_scale[d] = settings->force_gain[d] / (16 * 1000);
    }
    for (int d = 0; d < 2; d++) {
        plan->torque_scale[d] = settings->torque_gain[d] / (16 * 1e6);
    }
}

// One row of a tare in 1/16 count, every column `step` apart; false if a value is out of range.
static bool tare_row(const uint8_t *row, int32_t *tare_q4, int step)
{
    bool good = true;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double count;
        memcpy(&count, row + sizeof count * (size_t)i, sizeof count);
        bool inside = count >= 0 && count <= BT_FULL_SCALE_COUNT; // a NaN is not
        good &= inside;
        tare_q4[i * step] = (int32_t)((inside ? count : 0) * 16 + 0.5);
    }
    return good;
}

// Rows of counts to columns.
SPECIALISED void transpose(const uint8_t *rows, int64_t stride, uint16_t *restrict counts, int width)
{
    for (int k = 0; k < width; k++) {
        const uint8_t *row = rows + k * stride;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            memcpy(counts + i * width + k, row + 2 * i, 2);
        }
    }
}

// e = count - tare in 1/16 count, 0 for a missing electrode; false if a count is out of range.
SPECIALISED bool signals(const uint16_t *restrict counts, const int32_t *restrict tare_q4, int32_t *restrict e,
                         int width)
{
    int32_t seen = 0;
    for (int j = 0; j < BT_ELECTRODES * width; j++) {
        int32_t count = counts[j];
        int32_t signal = 16 * count - tare_q4[j];
        bool missing = count == BT_INVALID_COUNT;
        seen |= missing ? 0 : count;
        e[j] = missing ? 0 : signal;
    }
    return seen <= BT_FULL_SCALE_COUNT;
}

// A weight, negated, of e in 1/16 count: exact in int32 or double.
SPECIALISED int32_t compression(int32_t e)
{
    return e & -(e < 0);
}

SPECIALISED double weight(int32_t e, int weights)
{
    double m = weights == BT_POC_WEIGHTS_ABS_N2 ? e : compression(e);
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? m : -(m * m);
}

// Left and right share x, z and two of their arms: add and subtract before multiplying.
SPECIALISED void fold(const int32_t *restrict e, int weights, folded *restrict f, int width)
{
    for (int p = 0; p < BT_MIRRORED; p++) {
        const int32_t *right = e + right_of[p] * width;
        const int32_t *left = e + left_of[p] * width;
        for (int k = 0; k < width; k++) {
            int32_t a = right[k];
            int32_t b = left[k];
            f->even[p * width + k] = a + b;
            f->odd[p * width + k] = a - b;
            f->w_even[p * width + k] = weight(a, weights) + weight(b, weights);
            f->w_odd[p * width + k] = weight(a, weights) - weight(b, weights);
        }
    }
    for (int p = 0; p < BT_MIDLINE; p++) {
        const int32_t *middle = e + midline[p] * width;
        for (int k = 0; k < width; k++) {
            f->even[(BT_MIRRORED + p) * width + k] = middle[k];
            f->w_even[(BT_MIRRORED + p) * width + k] = weight(middle[k], weights);
        }
    }
}

// Written out because the compiler makes vectors of frames only from a loop body without loops.
#define ROW(a, p)   ((double)(a)[(p) * width + k])
#define TERM(a, c, p) (ROW(a, p) * (c)[p])
#define DOT_MIRRORED(a, c)                                                                                   \
    (TERM(a, c, 0) + TERM(a, c, 1) + TERM(a, c, 2) + TERM(a, c, 3) + TERM(a, c, 4) + TERM(a, c, 5)           \
     + TERM(a, c, 6))
#define DOT_FOLDED(a, c)                                                                                     \
    (DOT_MIRRORED(a, c) + TERM(a, c, 7) + TERM(a, c, 8) + TERM(a, c, 9) + TERM(a, c, 10) + TERM(a, c, 11))
#define SUM_FOLDED(a)                                                                                        \
    (ROW(a, 0) + ROW(a, 1) + ROW(a, 2) + ROW(a, 3) + ROW(a, 4) + ROW(a, 5) + ROW(a, 6) + ROW(a, 7)           \
     + ROW(a, 8) + ROW(a, 9) + ROW(a, 10) + ROW(a, 11))

typedef struct {
    double total[BLOCK];
    double moment[3][BLOCK];
    double force[3][BLOCK];
    double torque[3][BLOCK];
    double poc[3][BLOCK];
} columns;

SPECIALISED void sums(const bt_block_plan *restrict plan, const folded *restrict f, columns *restrict c,
                      int width)
{
    for (int k = 0; k < width; k++) {
        c->total[k] = SUM_FOLDED(f->w_even);
        c->moment[0][k] = DOT_FOLDED(f->w_even, plan->x_um);
        c->moment[1][k] = DOT_MIRRORED(f->w_odd, plan->y_um);
        c->moment[2][k] = DOT_FOLDED(f->w_even, plan->z_um);
        c->force[0][k] = DOT_FOLDED(f->even, plan->normal_x);
        c->force[1][k] = DOT_MIRRORED(f->odd, plan->normal_y);
        c->force[2][k] = DOT_FOLDED(f->even, plan->normal_z);
        c->torque[1][k] = DOT_FOLDED(f->even, plan->arm_y_nm);
        c->torque[2][k] = DOT_MIRRORED(f->odd, plan->arm_z_nm);
    }
}

// Eq 2 on the negated sums, scales and lever. Without a weight 0/0 makes the PoC and the lever NaN.
SPECIALISED void finish(const bt_block_plan *restrict plan, columns *restrict c, int width)
{
    double to_surface[BLOCK];
    double on_tip[BLOCK];
    double on_cylinder[BLOCK];
    for (int k = 0; k < width; k++) {
        double x = c->moment[0][k];
        double y = c->moment[1][k];
        double z = c->moment[2][k];
        double tip_x = x < 0 ? x : 0; // on the cylinder x takes no part in the length
        to_surface[k] = -(BT_CORE_RADIUS_UM / 1000.0) / sqrt(tip_x * tip_x + y * y + z * z);
        on_tip[k] = x * to_surface[k];
        on_cylinder[k] = x / (c->total[k] * 1000);
    }
    for (int k = 0; k < width; k++) {
        double y = c->moment[1][k] * to_surface[k];
        double z = c->moment[2][k] * to_surface[k];
        double force_y = c->force[1][k] * plan->force_scale[1];
        double force_z = c->force[2][k] * plan->force_scale[2];
        c->poc[0][k] = c->moment[0][k] < 0 ? on_tip[k] : on_cylinder[k];
        c->poc[1][k] = y;
        c->poc[2][k] = z;
        c->force[0][k] *= plan->force_scale[0];
        c->force[1][k] = force_y;
        c->force[2][k] = force_z;
        c->torque[0][k] = y * force_z - z * force_y;
        c->torque[1][k] *= plan->torque_scale[0];
        c->torque[2][k] *= plan->torque_scale[1];
    }
}

// Columns to rows of results.
SPECIALISED void store(const columns *restrict c, double *restrict results, int width)
{
    for (int k = 0; k < width; k++) {
        double *row = results + BT_RESULTS * k;
        for (int d = 0; d < 3; d++) {
            row[d] = c->poc[d][k];
            row[3 + d] = c->force[d][k];
            row[6 + d] = c->torque[d][k];
        }
    }
}

// false if a count is out of range.
SPECIALISED bool block(const bt_block_plan *plan, const uint8_t *rows, int64_t stride, const int32_t *tare_q4,
                       double *results, int width)
{
    uint16_t counts[BT_ELECTRODES * BLOCK];
    int32_t e[BT_ELECTRODES * BLOCK];
    folded f;
    columns c;
    transpose(rows, stride, counts, width);
    if (!signals(counts, tare_q4, e, width)) {
        return false;
    }
    switch (plan->poc_weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        fold(e, BT_POC_WEIGHTS_ABS_N2, &f, width);
        break;
    case BT_POC_WEIGHTS_COMPRESS_N2:
        fold(e, BT_POC_WEIGHTS_COMPRESS_N2, &f, width);
        break;
    default:
        fold(e, BT_POC_WEIGHTS_COMPRESS_N1, &f, width);
    }
    sums(plan, &f, &c, width);
    finish(plan, &c, width);
    store(&c, results, width);
    return true;
}

static bool block_of_many(const bt_block_plan *plan, const uint8_t *rows, int64_t stride,
                          const int32_t *tare_q4, double *results)
{
    return block(plan, rows, stride, tare_q4, results, BLOCK);
}

static bool block_of_one(const bt_block_plan *plan, const uint8_t *row, const int32_t *tare_q4,
                         double *results)
{
    return block(plan, row, 0, tare_q4, results, 1);
}

int64_t bt_blocks(const bt_block_plan *plan, int64_t n, const void *counts, int64_t counts_stride,
                  const void *tare, int64_t tare_stride, void *results)
{
    const uint8_t *rows = counts;
    const uint8_t *tares = tare;
    double *out = results;
    int32_t one_tare_q4[BT_ELECTRODES];
    int32_t tare_q4[BT_ELECTRODES * BLOCK];
    int64_t done = 0;

    if (tare_stride == 0) {
        if (!tare_row(tares, one_tare_q4, 1)) {
            return 0;
        }
        for (int j = 0; n >= BLOCK && j < BT_ELECTRODES * BLOCK; j++) {
            tare_q4[j] = one_tare_q4[j / BLOCK];
        }
    }
    for (; n - done >= BLOCK; done += BLOCK) {
        bool good = true;
        for (int k = 0; tare_stride != 0 && k < BLOCK; k++) {
            good &= tare_row(tares + (done + k) * tare_stride, tare_q4 + k, BLOCK);
        }
        if (!good || !block_of_many(plan, rows + done * counts_stride, counts_stride, tare_q4, out + BT_RESULTS * done)) {
            break; // the loop below finds the row
        }
    }
    for (; done < n; done++) {
        if (tare_stride != 0 && !tare_row(tares + done * tare_stride, one_tare_q4, 1)) {
            return done;
        }
        if (!block_of_one(plan, rows + done * counts_stride, one_tare_q4, out + BT_RESULTS * done)) {
            return done;
        }
    }
    return -1;
}
