// The kernels' results from exact int64 sums, without shortcuts. Like the double version in lin2013.h, a
// reference for firmware/core; never built for a board, where it would cost ten times as much. In: e in 1/16
// count (q4), |e| <= 4095 counts; gains in nN per count. Rounding half away from zero.
#ifndef BIOTAC_EXACT_H
#define BIOTAC_EXACT_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// Square root of 64 bits, the largest r with r * r <= n.
uint32_t exact_isqrt64(uint64_t n);

// PoC in nm, within 1 nm of Lin 2013 Eq 1 and 2. Returns false, with poc_nm unchanged, when all weights are
// 0.
bool exact_poc(const int32_t e_q4[BT_ELECTRODES], int weights, int32_t poc_nm[3]);

// Force in uN, Eq 3.
void exact_force_un(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[3], int64_t force_un[3]);

// Torque y and z in mN*mm, Eq 4; gain_nn holds y and z.
void exact_torque_yz_mnmm(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[2],
                          int64_t torque_mnmm[2]);

// Torque x in mN*mm: the lever (c x F)_x.
int64_t exact_torque_x_mnmm(const int32_t poc_nm[3], const int64_t force_un[3]);

#endif
