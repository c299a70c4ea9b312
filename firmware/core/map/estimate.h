// Estimates for electrodes that are out, from the others: a sum of their bounded signals, fitted to two
// fingers pressed and sheared on a plate (estimates.json). With the other finger's weights, a signal was off
// by a quarter of itself (RMS; tools/make/estimates.py --test).
//
// Units: counts; signals in 1/16 count (q4), rounded down.
#ifndef BIOTAC_ESTIMATE_H
#define BIOTAC_ESTIMATE_H

#include "wire/sensor_gen.h"

#include <stdint.h>

// Copy counts to completed, with estimates for the electrodes in `without`, a bit mask, that have a tare; of
// more than two none is estimated. A count of 0 means below 1, and becomes 1.
void bt_complete(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                 uint32_t without, uint16_t completed[BT_ELECTRODES]);

#endif
