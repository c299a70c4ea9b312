// Force and torque on the finger: Lin 2013 Eq 3 and 4, one gain per axis.
// In: e = count - tare in 1/16 count (q4), |e| <= 4095 counts; gains in nN per count.
// Force and torque act on the finger; the torque is about the origin (centre of the tip sphere).
#ifndef BIOTAC_WRENCH_H
#define BIOTAC_WRENCH_H

#include "sensor_gen.h"

#include <stdint.h>

#define BT_GAIN_MAX_NN 100000000 // the largest gain that link.toml lets through

// Force in uN, rounded half away from zero; cannot overflow.
void bt_force_un(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[3], int64_t force_un[3]);

// Torque y and z in mN*mm, rounded half away from zero; cannot overflow. gain_nn holds y and z.
void bt_torque_yz_mnmm(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[2], int64_t torque_mnmm[2]);

// Torque x from the lever, in mN*mm: (c x F)_x. Only E8 and E9 have any moment arm about x, so
// Eq 4 cannot measure it; what is published is this derived value, and it is flagged so.
int64_t bt_torque_x_derived_mnmm(const int32_t poc_nm[3], const int64_t force_un[3]);

#endif
