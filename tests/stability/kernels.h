// Every kernel under stress, one line each, and what each may be off the formulas in double
// (firmware/reference/lin2013.h), which judge them all.
//
// Signals are e = count - tare in 1/16 count (q4), |e| <= 4095 counts; gains in nN per count.
#ifndef BIOTAC_STRESS_KERNELS_H
#define BIOTAC_STRESS_KERNELS_H

#include "lin2013.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int weights; // enum bt_poc_weights
    int32_t force_nn[3];
    int32_t torque_nn[2]; // y, z
} kernel_case;

typedef struct {
    bool has_poc;
    double poc_um[3];
    double force_mn[3];
    double torque_mnmm[3]; // x is the lever; without a point it says nothing
} kernel_answer;

// Four measures of an error, and their bounds.
enum kind { KIND_POC, KIND_FORCE, KIND_TORQUE_YZ, KIND_TORQUE_X, KINDS };
extern const char *const kind_name[KINDS];
extern const char *const kind_unit[KINDS];

// What the bounds depend on, from the truth.
typedef struct {
    double size;      // sum |e|, count
    double gain_n[2]; // |gain| of torque y and z, N/count
    double sum[2];    // |sum| of Eq 4's y and z, count*um
    double force_n;   // |F_y| + |F_z|
} kernel_load;

typedef struct {
    const char *name;
    void (*run)(const int32_t e_q4[BT_ELECTRODES], const kernel_case *what, kernel_answer *answer);
    double (*bound)(enum kind kind, const kernel_load *load, int axis); // axis: 0 y, 1 z, for KIND_TORQUE_YZ
} kernel;

#define KERNELS 2
extern const kernel kernels[KERNELS];

// One with a defect; a stress that passes it is none.
extern const kernel defective_kernel;

// The truth for a frame, worked out once for all kernels.
typedef struct {
    lin2013_result result;
    kernel_load load;
} kernel_truth;

kernel_truth truth_of(const int32_t e_q4[BT_ELECTRODES], const kernel_case *what);

// An error of each kind, its bound, and which share of the bound it is; the kind's worse axis. Above 1, or
// infinite where only one side has a point or a result is no number: a violation.
typedef struct {
    double error[KINDS];
    double bound[KINDS];
    double share[KINDS];
} verdict;

verdict judge(const kernel *one, const int32_t e_q4[BT_ELECTRODES], const kernel_case *what,
              const kernel_truth *truth);

#endif
