#include "bounds.h"

#include "kernel_bounds.h"

const double bt_poc_bound_um = POC_BOUND_UM;
const double bt_force_bound_mn = FORCE_BOUND_MN;

void bt_torque_bounds_mnmm(int64_t n, const double *size, const double *sum_yz, const double *force_yz_n,
                           const double *gain_n, double *out)
{
    for (int64_t k = 0; k < n; k++) {
        out[3 * k] = torque_x_bound_mnmm(force_yz_n[k]);
        for (int d = 0; d < 2; d++) {
            out[3 * k + 1 + d] = torque_yz_bound_mnmm(size[k], gain_n[d], sum_yz[2 * k + d]);
        }
    }
}
