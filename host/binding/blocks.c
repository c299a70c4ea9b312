#include "blocks.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define BLOCK 16 // frames; 8 and 64 measured slower, 32 no faster

// The block's loops are compiled twice, for sixteen frames and for one: with the width a variable
// they would not become vectors.
#if defined(__GNUC__)
#define SPECIALISED static inline __attribute__((always_inline))
#else
#define SPECIALISED static inline
#endif

// Line by line along the finger: E1 | E2 E3 E5 | E4 E6 | E8 and their mirror images, then E7 | E10 |
// E17 E18 E19. Left and right share x, z and two of three arms, a line shares y, z and its normal: adding
// before multiplying leaves half of the arithmetic (34 -> 24 ns/frame measured for the lines alone).
static const int left_of[BT_MIRRORED] = {0, 1, 2, 4, 3, 5, 7};
static const int right_of[BT_ONE_SIDE] = {10, 11, 12, 14, 13, 15, 8, 6, 9, 16, 17, 18}; // or on the midline
static const int line_of[BT_ONE_SIDE] = {0, 1, 1, 1, 2, 2, 3, 4, 5, 6, 6, 6};
static const int first_of_line[BT_LINES] = {0, 1, 4, 6, 7, 8, 9};

// What the sums below leave out because it is 0.
static bool on_cylinder(int line)
{
    return line == 1 || line == 2 || line == 6;
}

static bool mirrored(int left, int right)
{
    return bt_electrode_um[left][0] == bt_electrode_um[right][0]
           && bt_electrode_um[left][1] == -bt_electrode_um[right][1]
           && bt_electrode_um[left][2] == bt_electrode_um[right][2]
           && bt_normal_milli[left][0] == bt_normal_milli[right][0]
           && bt_normal_milli[left][1] == -bt_normal_milli[right][1]
           && bt_normal_milli[left][2] == bt_normal_milli[right][2]
           && bt_arm_nm[left][1] == bt_arm_nm[right][1] && bt_arm_nm[left][2] == -bt_arm_nm[right][2];
}

static bool is_mirrored(void)
{
    bool good = true;
    for (int p = 0; p < BT_ONE_SIDE; p++) {
        int i = right_of[p];
        int first = right_of[first_of_line[line_of[p]]];
        for (int d = 0; d < 3; d++) {
            good &= bt_normal_milli[i][d] == bt_normal_milli[first][d];
            good &= d == 0 || bt_electrode_um[i][d] == bt_electrode_um[first][d];
        }
        good &= p < BT_MIRRORED ? mirrored(left_of[p], i) : mirrored(i, i);
        good &= !on_cylinder(line_of[p]) || bt_normal_milli[i][0] == 0;
    }
    return good && bt_normal_milli[right_of[first_of_line[3]]][1] == 0;
}

int bt_block_plan_init(bt_block_plan *plan, const lin2013_settings *settings, const double *population)
{
    plan->population = (const double (*)[3])population;
    plan->poc_weights = settings->poc_weights;
    for (int p = 0; p < BT_ONE_SIDE; p++) {
        plan->x_um[p] = bt_electrode_um[right_of[p]][0];
        plan->arm_y_nm[p] = bt_arm_nm[right_of[p]][1];
    }
    for (int p = 0; p < BT_MIRRORED; p++) {
        plan->arm_z_nm[p] = bt_arm_nm[right_of[p]][2];
    }
    for (int line = 0; line < BT_LINES; line++) {
        int i = right_of[first_of_line[line]];
        plan->z_um[line] = bt_electrode_um[i][2];
        plan->normal_x[line] = bt_normal_milli[i][0];
        plan->normal_z[line] = bt_normal_milli[i][2];
        if (line < BT_MIRRORED_LINES) {
            plan->y_um[line] = bt_electrode_um[i][1];
            plan->normal_y[line] = bt_normal_milli[i][1];
        }
    }
    for (int d = 0; d < 3; d++) {
        plan->force_scale[d] = settings->force_gain[d] / (16 * 1000);
    }
    for (int d = 0; d < 2; d++) {
        plan->torque_scale[d] = settings->torque_gain[d] / (16 * 1e6);
    }
    return is_mirrored();
}

// One row of a tare in 1/16 count, each value `step` after the one before; false if one is out of range.
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

// From here on one row per electrode, pair or result and one column per frame: [row * width + frame].
typedef struct {
    int32_t even[BT_ONE_SIDE * BLOCK];  // e of the right one + e of the left one, 1/16 count
    int32_t odd[BT_MIRRORED * BLOCK];   // e of the right one - e of the left one
    double w_even[BT_ONE_SIDE * BLOCK]; // the same of the weights, which are negated throughout
    double w_odd[BT_MIRRORED * BLOCK];
} sides;

typedef struct {
    double total[BLOCK];     // sum of the weights
    double moment[3][BLOCK]; // sum of weight * r
    double poc[3][BLOCK];
    double force[3][BLOCK];
    double torque[3][BLOCK];
} columns;

SPECIALISED void transpose(const uint8_t *restrict rows, int64_t stride, uint16_t *restrict counts, int width)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int k = 0; k < width; k++) {
            memcpy(counts + i * width + k, rows + k * stride + 2 * i, sizeof *counts);
        }
    }
}

// e = count - tare in 1/16 count, 0 for a missing electrode; false if a count is out of range.
SPECIALISED bool signals_of(const uint16_t *restrict counts, const int32_t *restrict tare_q4,
                            int32_t *restrict e, int width)
{
    uint16_t any = 0; // of 16 bits: twice as many in a vector
    for (int j = 0; j < BT_ELECTRODES * width; j++) {
        any = (uint16_t)(any | counts[j]);
    }
    if (any <= BT_FULL_SCALE_COUNT) { // nothing is missing, as nearly always
        for (int j = 0; j < BT_ELECTRODES * width; j++) {
            e[j] = 16 * counts[j] - tare_q4[j];
        }
        return true;
    }
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

SPECIALISED double negated_weight(int32_t e, int weights)
{
    int32_t compression = e & -(e < 0);
    double m = weights == BT_POC_WEIGHTS_ABS_N2 ? e : compression;
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? m : -(m * m);
}

SPECIALISED void to_sides(const int32_t *restrict e, int weights, sides *restrict f, int width)
{
    for (int p = 0; p < BT_MIRRORED; p++) {
        const int32_t *right = e + right_of[p] * width;
        const int32_t *left = e + left_of[p] * width;
        for (int k = 0; k < width; k++) {
            int32_t r = right[k];
            int32_t l = left[k];
            f->even[p * width + k] = r + l;
            f->odd[p * width + k] = r - l;
            f->w_even[p * width + k] = negated_weight(r, weights) + negated_weight(l, weights);
            f->w_odd[p * width + k] = negated_weight(r, weights) - negated_weight(l, weights);
        }
    }
    for (int p = BT_MIRRORED; p < BT_ONE_SIDE; p++) {
        const int32_t *middle = e + right_of[p] * width;
        for (int k = 0; k < width; k++) {
            f->even[p * width + k] = middle[k];
            f->w_even[p * width + k] = negated_weight(middle[k], weights);
        }
    }
}

// Written out: only a loop body without loops becomes vectors of frames.
#define AT(rows, p)           ((double)(rows)[(p) * width + k])
#define DOT(rows, p, factors) (AT(rows, p) * (factors)[p])
#define LINE_1(rows)          (AT(rows, 1) + AT(rows, 2) + AT(rows, 3))
#define LINE_2(rows)          (AT(rows, 4) + AT(rows, 5))
#define LINE_6(rows)          (AT(rows, 9) + AT(rows, 10) + AT(rows, 11))
#define SUM_PAIRS(rows, factors)                                                                             \
    (DOT(rows, 0, factors) + DOT(rows, 1, factors) + DOT(rows, 2, factors) + DOT(rows, 3, factors)           \
     + DOT(rows, 4, factors) + DOT(rows, 5, factors) + DOT(rows, 6, factors))
#define SUM_ONE_SIDE(rows, factors)                                                                          \
    (SUM_PAIRS(rows, factors) + DOT(rows, 7, factors) + DOT(rows, 8, factors) + DOT(rows, 9, factors)        \
     + DOT(rows, 10, factors) + DOT(rows, 11, factors))
#define SUM_LINES(rows, factors)                                                                             \
    (SUM_SIDES(rows, factors) + AT(rows, 6) * (factors)[3] + AT(rows, 7) * (factors)[4]                      \
     + AT(rows, 8) * (factors)[5] + LINE_6(rows) * (factors)[6])
#define SUM_TIP(rows, factors)                                                                               \
    (AT(rows, 0) * (factors)[0] + AT(rows, 6) * (factors)[3] + AT(rows, 7) * (factors)[4]                    \
     + AT(rows, 8) * (factors)[5])
#define SUM_SIDES(rows, factors)                                                                             \
    (AT(rows, 0) * (factors)[0] + LINE_1(rows) * (factors)[1] + LINE_2(rows) * (factors)[2])

SPECIALISED void sums(const bt_block_plan *restrict plan, const sides *restrict f, columns *restrict c,
                      int width)
{
    for (int k = 0; k < width; k++) {
        c->total[k] = AT(f->w_even, 0) + LINE_1(f->w_even) + LINE_2(f->w_even) + AT(f->w_even, 6)
                      + AT(f->w_even, 7) + AT(f->w_even, 8) + LINE_6(f->w_even);
        c->moment[0][k] = SUM_ONE_SIDE(f->w_even, plan->x_um);
        c->moment[1][k] = SUM_SIDES(f->w_odd, plan->y_um) + AT(f->w_odd, 6) * plan->y_um[3];
        c->moment[2][k] = SUM_LINES(f->w_even, plan->z_um);
        c->force[0][k] = SUM_TIP(f->even, plan->normal_x);
        c->force[1][k] = SUM_SIDES(f->odd, plan->normal_y);
        c->force[2][k] = SUM_LINES(f->even, plan->normal_z);
        c->torque[1][k] = SUM_ONE_SIDE(f->even, plan->arm_y_nm);
        c->torque[2][k] = SUM_PAIRS(f->odd, plan->arm_z_nm);
    }
}

// Eq 2 on the negated sums, scales, lever. With no weight at all 0/0 makes the PoC and the lever NaN.
// Several loops, because one with a choice or a sqrt() in it is not made into vectors.
SPECIALISED void finish(const bt_block_plan *restrict plan, columns *restrict c, int width)
{
    double tip_x[BLOCK];
    double length[BLOCK];
    double to_surface[BLOCK];
    double x_on_tip[BLOCK];
    double x_on_cylinder[BLOCK];
    for (int k = 0; k < width; k++) {
        tip_x[k] = c->moment[0][k] < 0 ? c->moment[0][k] : 0; // no part of the length on the cylinder
    }
    for (int k = 0; k < width; k++) {
        double y = c->moment[1][k];
        double z = c->moment[2][k];
        length[k] = tip_x[k] * tip_x[k] + y * y + z * z;
    }
    for (int k = 0; k < width; k++) {
        length[k] = sqrt(length[k]);
    }
    for (int k = 0; k < width; k++) {
        to_surface[k] = -(BT_CORE_RADIUS_UM / 1000.0) / length[k];
        x_on_tip[k] = c->moment[0][k] * to_surface[k];
        x_on_cylinder[k] = c->moment[0][k] / (c->total[k] * 1000);
    }
    for (int k = 0; k < width; k++) {
        double y = c->moment[1][k] * to_surface[k];
        double z = c->moment[2][k] * to_surface[k];
        double force_y = c->force[1][k] * plan->force_scale[1];
        double force_z = c->force[2][k] * plan->force_scale[2];
        c->poc[0][k] = c->moment[0][k] < 0 ? x_on_tip[k] : x_on_cylinder[k];
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

// Of a frame in a column of the block.
SPECIALISED void by_population(const bt_block_plan *plan, const uint16_t *counts, const int32_t *tare_q4,
                               double *results, int width)
{
    for (int k = 0; k < width; k++) {
        uint16_t its_counts[BT_ELECTRODES];
        int32_t its_tare_q4[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            its_counts[i] = counts[i * width + k];
            its_tare_q4[i] = tare_q4[i * width + k];
        }
        bt_population_replace(plan->population, its_counts, its_tare_q4, results + BT_RESULTS * k);
    }
}

// false if a count is out of range.
SPECIALISED bool block(const bt_block_plan *plan, const uint8_t *rows, int64_t stride, const int32_t *tare_q4,
                       double *results, int width)
{
    uint16_t counts[BT_ELECTRODES * BLOCK];
    int32_t e[BT_ELECTRODES * BLOCK];
    sides f;
    columns c;
    transpose(rows, stride, counts, width);
    if (!signals_of(counts, tare_q4, e, width)) {
        return false;
    }
    switch (plan->poc_weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        to_sides(e, BT_POC_WEIGHTS_ABS_N2, &f, width);
        break;
    case BT_POC_WEIGHTS_COMPRESS_N2:
        to_sides(e, BT_POC_WEIGHTS_COMPRESS_N2, &f, width);
        break;
    default:
        to_sides(e, BT_POC_WEIGHTS_COMPRESS_N1, &f, width);
    }
    sums(plan, &f, &c, width);
    finish(plan, &c, width);
    store(&c, results, width);
    if (plan->population != NULL) {
        by_population(plan, counts, tare_q4, results, width);
    }
    return true;
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
        if (!good
            || !block(plan, rows + done * counts_stride, counts_stride, tare_q4, out + BT_RESULTS * done,
                      BLOCK)) {
            break; // the loop below finds the row
        }
    }
    for (; done < n; done++) {
        if (tare_stride != 0 && !tare_row(tares + done * tare_stride, one_tare_q4, 1)) {
            return done;
        }
        if (!block(plan, rows + done * counts_stride, 0, one_tare_q4, out + BT_RESULTS * done, 1)) {
            return done;
        }
    }
    return -1;
}

int bt_one_frame(const bt_block_plan *plan, const void *counts, const void *tare, void *results)
{
    return bt_blocks(plan, 1, counts, 0, tare, 0, results) < 0;
}
