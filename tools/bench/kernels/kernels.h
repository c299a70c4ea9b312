// From signals to point of contact, force and torque in five ways, behind one signature, so that tools/bench
// can count and compare them. Only "shipped" is on a board.
//
// In: e = count - tare in 1/16 count (q4), |e| <= 4095 counts; compression is negative.
// Out: each kernel's own units and resolution; read() turns them into one, which is not counted.
#ifndef BIOTAC_KERNELS_H
#define BIOTAC_KERNELS_H

#include "lin2013.h"
#include "solve/solve.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// Gains and Table 1 in the form that each kernel multiplies by, worked out once.
typedef struct {
    int32_t force_nn[3];
    int32_t torque_nn[2];
    bt_solve_settings shipped;
    lin2013_settings real64;
    float f32_force[3];  // N per count
    float f32_torque[2]; // N per count
    float f32_place_mm[BT_ELECTRODES][3];
    float f32_normal[BT_ELECTRODES][3];
    float f32_arm_mm[BT_ELECTRODES][2];
} kernel_settings;

typedef union {
    lin2013_result real64;
    struct {
        int32_t poc_nm[3];
        int64_t force_un[3];
        int64_t torque_mnmm[3];
    } exact;
    struct {
        float poc_mm[3];
        float force_n[3];
        float torque_nmm[3];
    } f32;
    struct {
        int16_t poc_um[3];
        int32_t force_100un[3];
        int32_t torque_mnmm[3];
    } integer; // shipped and quick
} kernel_output;

typedef struct {
    double poc_um[3];
    double force_mn[3];
    double torque_mnmm[3]; // mN*mm is N*um
} kernel_result;

// False: no electrode weighs anything, there is no point and no torque x. Only the shipped kernel looks at
// `wanted` (BT_WANT_...); the others compute everything.
typedef bool kernel_run(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings, uint32_t wanted,
                        kernel_output *out);

typedef struct {
    const char *name;
    kernel_run *run;
    void (*read)(const kernel_output *out, kernel_result *result);
} kernel;

enum { KERNEL_SHIPPED, KERNELS = 5 };
extern const kernel kernels[KERNELS];

void kernel_settings_init(kernel_settings *settings, int poc_weights);

kernel_run kernel_float, kernel_quick;

// For the host: n frames of (n, 19) through one kernel; rows of out are point, force and torque, a NaN point
// where it gives none.
void kernel_frames(int index, int poc_weights, int64_t n, const int32_t *e_q4, double *out);

#endif
