// Point of contact on the core's surface: Lin 2013 Eq 1 and 2, fused, in 32-bit arithmetic.
// In: signals e = count - tare in 1/16 count (q4), |e| <= 4095 counts; compression is negative.
// Out: um, rounded half away from zero; within 1.1 um of the exact point for every input tried by
// tests/core/solve/test_kernels.c, of which 0.87 um is the rounding to whole um.
#ifndef BIOTAC_POC_H
#define BIOTAC_POC_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int16_t um[3];
    int32_t lever_yz[2]; // y and z in 10 mm / 2^17, for torque x
} bt_point;

// weights is an enum bt_poc_weights. Returns false and leaves point as it is when all weights are 0 (every e
// is 0, or none is compressed): no other input lacks an answer.
bool bt_poc(const int32_t e_q4[BT_ELECTRODES], int weights, bt_point *point);

#endif
