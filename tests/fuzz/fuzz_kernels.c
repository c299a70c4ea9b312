// Every variant of the kernels against the double oracle (firmware/reference/lin2013.c), on signals and
// gains that libFuzzer makes up. Input: weighting (1 byte), 19 signals and 5 gains (4 bytes each, little
// endian, signed). Missing bytes at the end are 0. Bounds: firmware/reference/kernel_bounds.h.
#include "input.h"

#include "exact.h"
#include "kernel_bounds.h"
#include "lin2013.h"
#include "solve/solve.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

typedef struct {
    int32_t e_q4[BT_ELECTRODES];
    int weights;
    int32_t force_nn[3];
    int32_t torque_nn[2];
} frame_input;

typedef struct {
    bool has_poc;
    double poc_um[3];
    double force_mn[3];
    double torque_mnmm[3];
} answer;

// Allowed error of a variant, for one frame. The PoC's is a length, the others are per axis.
typedef struct {
    double poc_um;
    double force_mn;
    double torque_mnmm[3];
} bounds;

// Inputs of the bounds: sum |e|, gain and sum of each torque axis, |F_y| + |F_z|.
typedef struct {
    double size;
    double gain_n[2];
    double sum[2];
    double force_n;
} load;

typedef struct {
    const char *name;
    void (*run)(const frame_input *in, answer *out);
    void (*bound)(const load *given, bounds *out);
} variant;

// ---- the kernel that ships -------------------------------------------------------------------------

static uint32_t run_wanted(const frame_input *in, uint32_t wanted, int16_t poc_um[3], int32_t force_100un[3],
                           int32_t torque_mnmm[3])
{
    bt_solve_settings settings = {.poc_weights = in->weights,
                                  .gains = bt_gains_from(in->force_nn, in->torque_nn)};
    return bt_solve(in->e_q4, &settings, wanted, poc_um, force_100un, torque_mnmm, NULL);
}

// A wanted result has the same value with or without the others, and the rest is marked.
static void check_wanted(const frame_input *in, const int16_t poc_um[3], const int32_t force_100un[3],
                         const int32_t torque_mnmm[3])
{
    for (uint32_t wanted = 0; wanted < BT_WANT_ALL; wanted++) {
        int16_t poc[3];
        int32_t force[3], torque[3];
        (void)run_wanted(in, wanted, poc, force, torque);
        for (int d = 0; d < 3; d++) {
            if (poc[d] != (wanted & BT_WANT_POC ? poc_um[d] : BT_INVALID_I16)
                || force[d] != (wanted & BT_WANT_FORCE ? force_100un[d] : BT_INVALID_I32)
                || torque[d] != (wanted & BT_WANT_TORQUE ? torque_mnmm[d] : BT_INVALID_I32)) {
                FAIL("with wanted = %u, the result differs on axis %d", wanted, d);
            }
        }
    }
}

static void shipped(const frame_input *in, answer *out)
{
    int16_t poc_um[3];
    int32_t force_100un[3], torque_mnmm[3];
    uint32_t flags = run_wanted(in, BT_WANT_ALL, poc_um, force_100un, torque_mnmm);
    out->has_poc = flags == 0;
    if (flags != 0 && (flags != BT_FRAME_FLAG_POC_INVALID || torque_mnmm[0] != BT_INVALID_I32)) {
        FAIL("flags %x, torque x %d", flags, torque_mnmm[0]);
    }
    for (int d = 0; d < 3; d++) {
        if ((poc_um[d] == BT_INVALID_I16) == out->has_poc) {
            FAIL("PoC %d is %d with flags %x", d, poc_um[d], flags);
        }
        out->poc_um[d] = poc_um[d];
        out->force_mn[d] = force_100un[d] * 0.1;
        out->torque_mnmm[d] = torque_mnmm[d];
    }
    check_wanted(in, poc_um, force_100un, torque_mnmm);
}

static void shipped_bounds(const load *given, bounds *out)
{
    out->poc_um = POC_BOUND_UM;
    out->force_mn = FORCE_BOUND_MN;
    out->torque_mnmm[0] = torque_x_bound_mnmm(given->force_n);
    for (int d = 0; d < 2; d++) {
        out->torque_mnmm[d + 1] = torque_yz_bound_mnmm(given->size, given->gain_n[d], given->sum[d]);
    }
}

// ---- exact int64 sums --------------------------------------------------------------------------------

static void exact(const frame_input *in, answer *out)
{
    int32_t poc_nm[3] = {0, 0, 0};
    int64_t force_un[3], torque_mnmm[2];
    out->has_poc = exact_poc(in->e_q4, in->weights, poc_nm);
    exact_force_un(in->e_q4, in->force_nn, force_un);
    exact_torque_yz_mnmm(in->e_q4, in->torque_nn, torque_mnmm);
    for (int d = 0; d < 3; d++) {
        out->poc_um[d] = poc_nm[d] * 1e-3;
        out->force_mn[d] = (double)force_un[d] * 1e-3;
    }
    out->torque_mnmm[0] = (double)exact_torque_x_mnmm(poc_nm, force_un);
    out->torque_mnmm[1] = (double)torque_mnmm[0];
    out->torque_mnmm[2] = (double)torque_mnmm[1];
}

// Half of the last digit of each, as exact.h states them; the lever's two inputs are off by as much. The
// terms of 1e-6 are the double's own error.
static void exact_bounds(const load *given, bounds *out)
{
    out->poc_um = 1e-3;
    out->force_mn = 0.5e-3 + 1e-6;
    out->torque_mnmm[0] = 0.5 + 2 * 5.08 * 0.5e-3 + 1e-3 * given->force_n + 1e-6;
    for (int d = 0; d < 2; d++) {
        out->torque_mnmm[d + 1] = 0.5 + 0.5 / 16 * given->gain_n[d] + 1e-6;
    }
}

// ---- the comparison ------------------------------------------------------------------------------------

static const variant variants[] = {
    {"shipped", shipped, shipped_bounds},
    {"exact", exact, exact_bounds},
};

static void check(const variant *v, const answer *got, const lin2013_result *want, const bounds *allowed)
{
    double square = 0;
    for (int d = 0; d < 3; d++) {
        double off = got->force_mn[d] - want->force_n[d] * 1000;
        if (!(fabs(off) <= allowed->force_mn)) {
            FAIL("%s: force %d is off by %.9g mN, allowed %.9g", v->name, d, off, allowed->force_mn);
        }
        double poc_off = got->poc_um[d] - want->poc_mm[d] * 1000;
        square += poc_off * poc_off;
    }
    if (got->has_poc == isnan(want->poc_mm[0])) {
        FAIL("%s: a PoC where the reference has none, or none where it has one", v->name);
    }
    if (got->has_poc && !(sqrt(square) <= allowed->poc_um)) {
        FAIL("%s: PoC is off by %.9g um, allowed %.9g", v->name, sqrt(square), allowed->poc_um);
    }
    for (int d = got->has_poc ? 0 : 1; d < 3; d++) {
        double off = got->torque_mnmm[d] - want->torque_nmm[d] * 1000;
        if (!(fabs(off) <= allowed->torque_mnmm[d])) {
            FAIL("%s: torque %d is off by %.9g mN*mm, allowed %.9g", v->name, d, off,
                 allowed->torque_mnmm[d]);
        }
    }
}

static void oracle(const frame_input *in, lin2013_result *want, load *given)
{
    lin2013_settings settings = {.poc_weights = in->weights};
    double e[BT_ELECTRODES];
    *given = (load){0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = in->e_q4[i] / 16.0;
        given->size += fabs(e[i]);
    }
    for (int d = 0; d < 3; d++) {
        settings.force_gain[d] = in->force_nn[d] * 1e-9;
    }
    for (int d = 0; d < 2; d++) {
        settings.torque_gain[d] = in->torque_nn[d] * 1e-9;
    }
    lin2013(e, &settings, want);
    for (int d = 0; d < 2; d++) {
        given->gain_n[d] = fabs(settings.torque_gain[d]);
        given->sum[d] = given->gain_n[d] > 0 ? fabs(want->torque_nmm[d + 1]) / given->gain_n[d] * 1000 : 0;
    }
    given->force_n = fabs(want->force_n[1]) + fabs(want->force_n[2]);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    fuzz_input input = {data, bytes};
    frame_input in;
    in.weights = next_u8(&input) % (BT_SETTING_POC_WEIGHTS_MAX + 1);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        in.e_q4[i] = next_within(&input, BT_E_MAX_Q4);
    }
    for (int d = 0; d < 3; d++) {
        in.force_nn[d] = next_within(&input, BT_GAIN_MAX_NN);
    }
    for (int d = 0; d < 2; d++) {
        in.torque_nn[d] = next_within(&input, BT_GAIN_MAX_NN);
    }
    lin2013_result want;
    load given;
    oracle(&in, &want, &given);
    for (size_t k = 0; k < sizeof variants / sizeof variants[0]; k++) {
        answer got;
        bounds allowed;
        memset(&got, 0, sizeof got);
        variants[k].run(&in, &got);
        variants[k].bound(&given, &allowed);
        check(&variants[k], &got, &want, &allowed);
    }
    return 0;
}
