// The population map (firmware/core/map/population.h) in double, of one frame, for the host.
#ifndef BIOTAC_POPULATION_FLOAT64_H
#define BIOTAC_POPULATION_FLOAT64_H

#include "wire/sensor_gen.h"

#include <stdint.h>

// N a count, then N a count and gate x, and gate y; of each the compressed electrodes', then the bulging
// ones'.
#define BT_POPULATION_COLUMNS (6 * BT_ELECTRODES)

// results: poc_mm, force_n, torque_nmm of Lin's, of which force becomes the published one, and torque x what
// follows. counts: 0..4095 or BT_INVALID_COUNT.
void bt_population_replace(const double coefficient[BT_POPULATION_COLUMNS][3],
                           const uint16_t counts[BT_ELECTRODES], const int32_t tare_q4[BT_ELECTRODES],
                           double *results);

#endif
