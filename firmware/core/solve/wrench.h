// Force and torque on the finger: Lin 2013 Eq 3 and 4, one gain per axis, in 32-bit arithmetic.
// In: e = count - tare in 1/16 count (q4), |e| <= 4095 counts; gains in nN per count.
// Force and torque act on the finger; the torque is about the origin (centre of the tip sphere). Outputs
// round half away from zero. No input overflows: the gains' range prevents it (assertions in wrench.c), so
// nothing saturates.
#ifndef BIOTAC_WRENCH_H
#define BIOTAC_WRENCH_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdint.h>

// Gains as multipliers of the sums, computed once per change of settings.
typedef struct {
    uint16_t high, low; // magnitude
    int32_t sign;       // 0 or -1
} bt_gain;

typedef struct {
    bt_gain force[3];  // 100 uN per (1/16 count * 1/1000), times 2^34
    bt_gain torque[2]; // y, z: mN*mm per BT_SUMS_TORQUE_UNIT_NM of 1/16 count, times 2^35
} bt_gains;

#define BT_GAIN_MAX_NN BT_SETTING_FORCE_GAIN_X_NN_MAX // and of every other gain, see wrench.c

bt_gains bt_gains_from(const int32_t force_nn[3], const int32_t torque_nn[2]);

// Force in 100 uN; or without x, which no torque needs.
void bt_force(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t force_100un[3]);
void bt_force_yz(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t force_100un[3]);

// Torque y and z in mN*mm.
void bt_torque_yz(const int32_t e_q4[BT_ELECTRODES], const bt_gains *gains, int32_t torque_mnmm[2]);

// Torque x from the lever, in mN*mm: (c x F)_x. Only E8 and E9 have any moment arm about x, so Eq 4 cannot
// measure it; this derived value is published instead, and flagged as such.
int32_t bt_torque_x_derived(const int32_t lever_yz[2], const int32_t force_100un[3]);

#endif
