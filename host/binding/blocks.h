// Lin 2013 Eq 1-4 in double over recorded frames, sixteen at a time, for the host.
//
// Every sum is a sum of whole numbers below 2^53 and therefore exact, in whatever order it is taken;
// only the last few steps of a frame round. So a frame's results do not depend on its neighbours, on n
// or on the compiler's vectors.
#ifndef BIOTAC_BLOCKS_H
#define BIOTAC_BLOCKS_H

#include "lin2013.h"
#include "population_float64.h"

#define BT_MIRRORED       7  // pairs of electrodes left and right of the midline
#define BT_ONE_SIDE       12 // the pairs, and the electrodes on the midline
#define BT_LINES          7  // of them along the finger, with y, z and normal in common
#define BT_MIRRORED_LINES 4
#define BT_RESULTS        9 // poc_mm, force_n, torque_nmm of one frame

// The settings and the generated geometry, mirrored at the midline.
typedef struct {
    const double (*population)[3]; // [BT_POPULATION_COLUMNS]; NULL: force is Lin's
    int poc_weights;
    double x_um[BT_ONE_SIDE];
    double arm_y_nm[BT_ONE_SIDE];
    double arm_z_nm[BT_MIRRORED];
    double y_um[BT_MIRRORED_LINES];
    double z_um[BT_LINES];
    double normal_x[BT_LINES]; // 1/1000
    double normal_y[BT_MIRRORED_LINES];
    double normal_z[BT_LINES];
    double force_scale[3];  // N per 1/16 count * 1/1000
    double torque_scale[2]; // N*mm per 1/16 count * nm
} bt_block_plan;

// population: coefficients that outlive the plan, or NULL. 0 if the generated geometry is not mirrored as
// this file believes; the plan is not to be used then.
int bt_block_plan_init(bt_block_plan *plan, const lin2013_settings *settings, const double *population);

// counts: n rows of 19 uint16, counts_stride bytes apart, of any alignment; 0..4095 or
// BT_INVALID_COUNT. tare: n rows of 19 doubles in counts, 0..4095, tare_stride bytes apart, or one row
// for all of them if tare_stride is 0; rounded to 1/16 count as on the board. results: (n, 9) doubles
// without padding; NaN where there is no PoC. Returns -1, or the first row that is out of range; then
// results are not to be used.
int64_t bt_blocks(const bt_block_plan *plan, int64_t n, const void *counts, int64_t counts_stride,
                  const void *tare, int64_t tare_stride, void *results);

// The same for one frame; true if it is in range. Fewer arguments: converting them counts here.
int bt_one_frame(const bt_block_plan *plan, const void *counts, const void *tare, void *results);

#endif
