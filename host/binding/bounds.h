// firmware/reference/kernel_bounds.h for arrays: how far an on-board result may be from the formulas.
#ifndef BIOTAC_BOUNDS_H
#define BIOTAC_BOUNDS_H

#include <stdint.h>

extern const double bt_poc_bound_um;
extern const double bt_force_bound_mn; // of each axis

// For n frames: size (n) is sum |e| in count, sum_yz (n, 2) those of Eq 4 in count*um, force_yz_n (n) is
// |F_y| + |F_z|, none negative; gain_n (2) in N per count. out (n, 3): x, y, z.
void bt_torque_bounds_mnmm(int64_t n, const double *size, const double *sum_yz, const double *force_yz_n,
                           const double *gain_n, double *out);

#endif
