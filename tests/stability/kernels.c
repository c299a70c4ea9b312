#include "kernels.h"

#include "gold.h"
#include "kernel_bounds.h"
#include "solve/solve.h"

#include <math.h>

#define POC_PROMISED_UM 1.1

const char *const kind_name[KINDS] = {"PoC", "force", "torque y z", "torque x"};
const char *const kind_unit[KINDS] = {"um", "mN", "mN*mm", "mN*mm"};

// ---- the kernel that ships -------------------------------------------------------------------------

static void shipped_run(const int32_t e_q4[BT_ELECTRODES], const kernel_case *what, kernel_answer *answer)
{
    bt_solve_settings settings = {.poc_weights = what->weights,
                                  .gains = bt_gains_from(what->force_nn, what->torque_nn)};
    int16_t poc_um[3];
    int32_t force_100un[3], torque_mnmm[3];
    uint32_t flags = bt_solve(e_q4, &settings, BT_WANT_ALL, poc_um, force_100un, torque_mnmm);
    answer->has_poc = flags == 0;
    for (int d = 0; d < 3; d++) {
        // A mark where there is a point, or a point where there is a mark, is off by all.
        bool marked = poc_um[d] == BT_INVALID_I16;
        answer->poc_um[d] = marked == answer->has_poc ? (double)NAN : poc_um[d];
        answer->force_mn[d] = force_100un[d] == BT_INVALID_I32 ? (double)NAN : force_100un[d] * 0.1;
        answer->torque_mnmm[d] = torque_mnmm[d];
    }
    if ((torque_mnmm[0] == BT_INVALID_I32) == answer->has_poc) {
        answer->torque_mnmm[0] = (double)NAN;
    }
}

static double shipped_bound(enum kind kind, const kernel_load *load, int axis)
{
    switch (kind) {
    case KIND_POC:
        // What SPEC.md and poc.h promise, which is less than what can be proved frame by frame.
        return POC_PROMISED_UM;
    case KIND_FORCE:
        return FORCE_BOUND_MN;
    case KIND_TORQUE_YZ:
        return torque_yz_bound_mnmm(load->size, load->gain_n[axis], load->sum[axis]);
    default:
        return torque_x_bound_mnmm(load->force_n);
    }
}

// What fuzzing once found and six million random frames had not: x cut short next to the seam. Here to prove
// that it would be found now.
static void defective_run(const int32_t e_q4[BT_ELECTRODES], const kernel_case *what, kernel_answer *answer)
{
    shipped_run(e_q4, what, answer);
    answer->poc_um[0] += fabs(answer->poc_um[0]) <= 1 ? 2 : 0;
}

// ---- the gold kernels ------------------------------------------------------------------------------

static void gold_run(const int32_t e_q4[BT_ELECTRODES], const kernel_case *what, kernel_answer *answer)
{
    int32_t poc_nm[3] = {0, 0, 0};
    int64_t force_un[3], torque_yz[2];
    answer->has_poc = gold_poc(e_q4, what->weights, poc_nm);
    gold_force_un(e_q4, what->force_nn, force_un);
    gold_torque_yz_mnmm(e_q4, what->torque_nn, torque_yz);
    answer->torque_mnmm[0] = (double)gold_torque_x_mnmm(poc_nm, force_un);
    for (int d = 0; d < 3; d++) {
        answer->poc_um[d] = poc_nm[d] / 1000.0;
        answer->force_mn[d] = (double)force_un[d] / 1000;
        if (d > 0) {
            answer->torque_mnmm[d] = (double)torque_yz[d - 1];
        }
    }
}

// gold.h: a point within 1 nm per axis, the rest rounded to its unit. Each with a margin of 1e-6 of a unit
// for what the double may be off; torque x: 1 nm on each force, half a uN on 5.08 mm, twice.
static double gold_bound(enum kind kind, const kernel_load *load, int axis)
{
    switch (kind) {
    case KIND_POC:
        return 0.001 * SQRT_3 + 1e-6;
    case KIND_FORCE:
        return 0.0005 + 1e-6;
    case KIND_TORQUE_YZ:
        return 0.5 + load->gain_n[axis] / 32 + 1e-6;
    default:
        return 0.5 + 0.001 * load->force_n + 2 * 5.081 * 0.0005 + 1e-6;
    }
}

// ---- all of them; a variant is a line here ----------------------------------------------------------

const kernel kernels[KERNELS] = {
    {"shipped", shipped_run, shipped_bound},
    {"gold", gold_run, gold_bound},
};

const kernel defective_kernel = {"defective", defective_run, shipped_bound};
