// Results of recorded frames in double, for the host: Lin 2013 (firmware/reference/lin2013.h), and the
// population map (firmware/core/map/population.h) for its force.
#ifndef BIOTAC_COMPUTE_H
#define BIOTAC_COMPUTE_H

#include "lin2013.h"
#include "map/map.h"

#include <stdint.h>

// Of an electrode, compressed or bulging: force in N a count, the same a count and gate x, and gate y; then
// the weight of the compression's centroid, and the moments over the gates' reaches.
typedef double bt_population_column[12];

typedef struct {
    lin2013_settings lin;
    // Compressed, then bulging electrodes, then the sums' first values; NULL: force is Lin's.
    const bt_population_column *population;
    uint32_t wanted; // BT_QUANTITY_FLAG_POC, FORCE and TORQUE; the others become NaN
} bt_formulas;

// The population map's force of signals as from bt_signals_q4, without a board's roundings. Returns the most
// that these can change, in 100 uN (tests/host/map/test_population_force.py).
double bt_map_force(const bt_population_column *columns, const int32_t e_q4[BT_ELECTRODES],
                    uint32_t firm_100un, double force_n[3]);

// A row of biotac.RESULT_DTYPE. The half widths are a board's for a confirmed tare and a noiseless finger
// (solve/interval.h); NaN where an electrode is missing, which is not estimated here.
typedef struct {
    lin2013_result lin;
    double normal_n, normal_half_n, shear_n, shear_half_n;
} bt_computed;

// counts: n rows of 19 uint16, counts_stride bytes apart, of any alignment; 0..4095 or BT_INVALID_COUNT.
// tare: n rows of 19 doubles in counts, 0..4095, tare_stride bytes apart, or one row for all of them if
// tare_stride is 0; rounded to 1/16 count as on the board. results: n bt_computed, NaN where there is no
// PoC. Returns -1, or the first row that is out of range; then results are not to be used.
int64_t bt_compute(const bt_formulas *formulas, int64_t n, const void *counts, int64_t counts_stride,
                   const void *tare, int64_t tare_stride, void *results);

// The same for one frame; true if it is in range. Fewer arguments: converting them counts here.
int bt_compute_frame(const bt_formulas *formulas, const void *counts, const void *tare, void *results);

#endif
