// The on-board kernels over many recorded frames at once, for the host.
#ifndef BIOTAC_BATCH_H
#define BIOTAC_BATCH_H

#include "keep/calibration.h"
#include "map/lesson.h"
#include "map/map.h"
#include "signal/round.h"
#include "solve/pressure.h"
#include "solve/results.h"
#include "solve/solve.h"

// counts, tare_q4: (n, 19). poc_um, force_100un, torque_mnmm: (n, 3). torsion_mnmm, flags, and
// pdc_above_rest_q4, which a map may need: (n,). flags has only POC_INVALID, POPULATION and OUTSIDE. Every
// row goes through bt_signals_q4, and bt_solve_mapped or bt_solve, as on the board.
void bt_kernel_frames(int64_t n, const uint16_t *counts, const uint16_t *tare_q4,
                      const int32_t *pdc_above_rest_q4, const bt_solve_settings *settings, int16_t *poc_um,
                      int32_t *force_100un, int32_t *torque_mnmm, int32_t *torsion_mnmm, uint32_t *flags);

// The same by a map alone, and the factors (n, 10) that are compared with the lesson of that map; an axis
// that the map lacks is BT_INVALID_I32.
void bt_map_frames(int64_t n, const uint16_t *counts, const uint16_t *tare_q4,
                   const int32_t *pdc_above_rest_q4, const bt_map *map, int32_t *force_100un,
                   int32_t *torque_mnmm, int32_t *torsion_mnmm, int32_t *factor);

// The same of pressure. filtered_q4, tare_q4, force_100un: (n,).
void bt_pressure_forces(int64_t n, const uint16_t *filtered_q4, const uint16_t *tare_q4, int32_t gain_nn,
                        int32_t *force_100un);

// Macros of the core, which cffi does not see.
enum bt_macros {
    BT_THRESHOLD_RAIL_COUNT = BT_RAIL_COUNT,
    BT_THRESHOLD_ACTIVE_Q4 = BT_ACTIVE_Q4,
    BT_THRESHOLD_ACTIVE_FOR_TORSION = BT_ACTIVE_FOR_TORSION,
    BT_FACTORS_OF_LESSON = BT_LESSON_FACTORS,
    BT_ROWS_OF_LESSON = BT_LESSON_ROWS,
    BT_VERSION_OF_LESSON = BT_LESSON_VERSION,
    BT_CALIBRATION_VERSION = BT_CALIBRATION_RECORD_VERSION,
};

// Compared with host/biotac/wire/messages_gen.py when the module is imported.
uint32_t bt_binding_schema_hash(void);

#endif
