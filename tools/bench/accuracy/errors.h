// How far each kernel variant is from the exact result, for tools/bench/front.
//
// The judge is neither of the references: sums of whole numbers in int64, exact, and the last quotient
// or root in long double. A variant's error is what it is off by: the point's distance in um; of the force in
// mN and of torque y and z in mN*mm (N*um), the axis that is furthest off; of torque x.
#ifndef BIOTAC_ERRORS_H
#define BIOTAC_ERRORS_H

#include <stdint.h>

#define BT_KERNEL_ERRORS 4 // PoC, force, torque y z, torque x

// What is asked for, and with what gains in nN per count.
typedef struct {
    int poc_weights;
    int32_t force_nn[3];
    int32_t torque_nn[2];
} bt_kernel_case;

int bt_kernel_variants(void);
const char *bt_kernel_name(int variant);

// e_q4: (n, 19), signals in 1/16 count, |e| <= 4095 counts. errors: (n, 4). Point and torque x are NaN
// where the judge has none, and infinite where only one of the two has.
void bt_kernel_errors(int variant, const bt_kernel_case *what, int64_t n, const int32_t *e_q4,
                      double *errors);

// Frames for the clock: n of them through one variant. The result keeps the compiler from dropping them.
int64_t bt_kernel_run(int variant, const bt_kernel_case *what, int64_t n, const int32_t *e_q4);

// The largest error of one kind (0..3) that hill climbing finds: `restarts` times from a random frame,
// `steps` changes each, kept if they do not lower the error. Deterministic.
double bt_kernel_climb(int variant, const bt_kernel_case *what, int kind, uint64_t seed, int restarts,
                       int steps);

#endif
