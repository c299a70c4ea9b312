// Lin 2013 Eq 1-4 in double over recorded frames, for the host.
//
// Every sum is a sum of whole numbers below 2^53 and therefore exact, in whatever order it is taken; only
// the last few steps of a frame round.
#ifndef BIOTAC_LIN_FLOAT64_H
#define BIOTAC_LIN_FLOAT64_H

#include "lin2013.h"
#include "population_float64.h"

#define BT_RESULTS 9 // poc_mm, force_n, torque_nmm of one frame

// The settings, and what an electrode's weight and signal are multiplied by, side by side for the sums.
typedef struct {
    const double (*population)[3]; // [BT_POPULATION_COLUMNS]; NULL: force is Lin's
    int poc_weights;
    double of_weight[BT_ELECTRODES][4];
    double of_signal[BT_ELECTRODES][5]; // normal in 1/1000; arm about y and z in nm
    double force_scale[3];              // N per 1/16 count * 1/1000
    double torque_scale[2];             // N*mm per 1/16 count * nm
} bt_lin_plan;

// population: coefficients that outlive the plan, or NULL.
void bt_lin_plan_init(bt_lin_plan *plan, const lin2013_settings *settings, const double *population);

// counts: n rows of 19 uint16, counts_stride bytes apart, of any alignment; 0..4095 or
// BT_INVALID_COUNT. tare: n rows of 19 doubles in counts, 0..4095, tare_stride bytes apart, or one row
// for all of them if tare_stride is 0; rounded to 1/16 count as on the board. results: (n, 9) doubles
// without padding; NaN where there is no PoC. Returns -1, or the first row that is out of range; then
// results are not to be used.
int64_t bt_lin_frames(const bt_lin_plan *plan, int64_t n, const void *counts, int64_t counts_stride,
                      const void *tare, int64_t tare_stride, void *results);

// The same for one frame; true if it is in range. Fewer arguments: converting them counts here.
int bt_one_frame(const bt_lin_plan *plan, const void *counts, const void *tare, void *results);

#endif
