// Every way this project knows to get from signals to point of contact, force and torque, behind one
// signature, so that a benchmark and a test can put them side by side. Only "shipped" is on a board.
//
// In: e = count - tare in 1/16 count (q4), |e| <= 4095 counts; compression is negative.
// Out: each variant's own units and resolution; read() turns them into one, outside of what is timed.
#ifndef BIOTAC_VARIANTS_H
#define BIOTAC_VARIANTS_H

#include "lin2013.h"
#include "solve/solve.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// What is asked of a variant. Torque includes torque x and therefore computes point and force too.
#define VARIANT_POC    1
#define VARIANT_FORCE  2
#define VARIANT_TORQUE 4
#define VARIANT_ALL    7

// 1/16 count * 1/1000 * nN to 100 uN.
#define FPU_FORCE_BITS    34
#define FPU_FORCE_DIVISOR 1600000000LL

// gain * 2^36 * 4096 / (16 * 10^12), the powers of two taken out: nN, 1/16 count, nm to mN*mm.
#define FPU_TORQUE_SHIFT   36
#define FPU_TORQUE_BITS    32
#define FPU_TORQUE_DIVISOR 244140625LL // 5^12

// A factor of at most 12 bits: value * mantissa >> shift.
typedef struct {
    int16_t mantissa;
    int16_t shift;
} q15_gain;

// The settings in the form that each variant multiplies by, worked out once per change.
typedef struct {
    int poc_weights; // enum bt_poc_weights
    int32_t force_nn[3];
    int32_t torque_nn[2];
    bt_solve_settings shipped;
    lin2013_settings real64;
    float f32_force[3];       // N per count
    float f32_torque[2];      // N per count
    float mirrored_force[3];  // mN per (1/16 count * 1/1000)
    float mirrored_torque[2]; // mN*mm per (1/16 count * nm)
    int32_t fpu_force[3];     // 100 uN per (1/16 count * 1/1000), times 2^34
    int32_t fpu_torque[2];    // mN*mm per (1/16 count * 4096 nm), times 2^36
    q15_gain q15_force[3];    // 100 uN per 1/8 count
    q15_gain q15_torque[2];   // mN*mm per (1/8 count * full scale of the arms)
} variant_settings;

typedef struct {
    int32_t poc_nm[3];
    int64_t force_un[3];
    int64_t torque_mnmm[3];
} gold_output;

typedef struct {
    float poc_mm[3];
    float force_n[3];
    float torque_nmm[3];
} f32_output;

typedef struct {
    float poc_um[3];
    float force_mn[3];
    float torque_mnmm[3];
} mirrored_output;

typedef struct {
    int32_t poc_um_q3[3]; // 1/8 um
    int32_t force_100un[3];
    int32_t torque_mnmm[3];
} fpu_output;

typedef struct {
    int16_t poc_um[3];
    int32_t force_100un[3];
    int32_t torque_mnmm[3];
} integer_output; // shipped and Q15

typedef union {
    lin2013_result real64;
    gold_output gold;
    f32_output f32;
    mirrored_output mirrored;
    fpu_output fpu;
    integer_output integer;
} variant_output;

typedef struct {
    double poc_um[3];
    double force_mn[3];
    double torque_mnmm[3]; // mN*mm is N*um
} variant_result;

// Fill what is wanted of out. False: no electrode weighs anything, there is no point and no torque x.
typedef bool variant_run(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                         variant_output *out);
typedef void variant_read(const variant_output *out, variant_result *result);

typedef struct {
    const char *name;
    variant_run *run;
    variant_read *read;
    bool in_parts; // obeys `wanted`; false: always computes everything
} variant;

#define VARIANTS 7
extern const variant variants[VARIANTS];

void variant_settings_init(variant_settings *settings, int poc_weights, const int32_t force_nn[3],
                           const int32_t torque_nn[2]);

// The kernels of this folder, one a file, and the adapters of the others (judges.c, shipped.c).
variant_run variant_double, variant_f32, variant_f32_mirrored, variant_gold, variant_shipped, variant_q15,
    variant_fpu;

#endif
