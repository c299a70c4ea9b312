// Point of contact on the core's surface: Lin 2013 Eq 1 and 2, fused.
// In: signals e = count - tare in 1/16 count (q4), |e| <= 4095 counts; compression is negative.
// Out: nm, rounded half away from zero; exact sums, so the error is below 1 nm per axis plus the
// square root's 2^-30.
#ifndef BIOTAC_POC_H
#define BIOTAC_POC_H

#include "sensor_gen.h"
#include "wire_gen.h"

#include <stdbool.h>
#include <stdint.h>

// weights is an enum bt_poc_weights. Returns false, leaving poc_nm alone, when no electrode weighs
// anything (every e is 0, or none is compressed): that is the only input without an answer.
bool bt_poc(const int32_t e_q4[BT_ELECTRODES], int weights, int32_t poc_nm[3]);

#endif
