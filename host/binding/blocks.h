// Lin 2013 Eq 1-4 in double over recorded frames, sixteen at a time, for the host.
//
// Every sum is a sum of whole numbers below 2^53 and therefore exact, in whatever order it is taken;
// only the last few steps of a frame round. So a frame's results do not depend on its neighbours, on n
// or on the compiler's vectors. Agrees with firmware/reference to 1e-12 (tests/host/test_batch.py).
#ifndef BIOTAC_BLOCKS_H
#define BIOTAC_BLOCKS_H

#include "lin2013.h"

#define BT_MIRRORED 7 // pairs of electrodes left and right of the midline
#define BT_MIDLINE  5 // electrodes on it
#define BT_FOLDED   12
#define BT_RESULTS  9 // poc_mm, force_n, torque_nmm of one frame

// The settings and the generated geometry as the loops want them: the pairs first, then the midline.
typedef struct {
    int poc_weights;
    double x_um[BT_FOLDED];
    double z_um[BT_FOLDED];
    double y_um[BT_MIRRORED];
    double normal_x[BT_FOLDED]; // 1/1000
    double normal_z[BT_FOLDED];
    double normal_y[BT_MIRRORED];
    double arm_y_nm[BT_FOLDED];
    double arm_z_nm[BT_MIRRORED];
    double force_scale[3];  // N per 1/16 count * 1/1000
    double torque_scale[2]; // N*mm per 1/16 count * nm
} bt_block_plan;

void bt_block_plan_init(bt_block_plan *plan, const lin2013_settings *settings);

// counts: n rows of 19 uint16, counts_stride bytes apart, of any alignment; 0..4095 or
// BT_INVALID_COUNT. tare: n rows of 19 doubles in counts, 0..4095, tare_stride bytes apart, or one row
// for all of them if tare_stride is 0; rounded to 1/16 count as on the board. results: (n, 9) doubles
// without padding; NaN where there is no PoC. Returns -1, or the first row that is out of range; then
// results are not to be used.
int64_t bt_blocks(const bt_block_plan *plan, int64_t n, const void *counts, int64_t counts_stride,
                  const void *tare, int64_t tare_stride, void *results);

#endif
