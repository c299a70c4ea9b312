#include "kernels.h"

#include <math.h>

kernel_truth truth_of(const int32_t e_q4[BT_ELECTRODES], const kernel_case *what)
{
    kernel_truth truth = {.load = {.size = 0}};
    lin2013_settings settings = {.poc_weights = what->weights};
    double e[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = e_q4[i] / 16.0;
        truth.load.size += fabs(e[i]);
    }
    for (int d = 0; d < 3; d++) {
        settings.force_gain[d] = what->force_nn[d] * 1e-9;
    }
    for (int d = 0; d < 2; d++) {
        settings.torque_gain[d] = what->torque_nn[d] * 1e-9;
        truth.load.gain_n[d] = fabs(settings.torque_gain[d]);
    }
    lin2013(e, &settings, &truth.result);
    for (int d = 0; d < 2; d++) {
        truth.load.sum[d] = fabs(truth.result.torque_sum[d + 1]) * 1000;
    }
    truth.load.force_n = fabs(truth.result.force_n[1]) + fabs(truth.result.force_n[2]);
    return truth;
}

// NaN, of which nothing is known, counts as infinitely far off.
static void raise_to(verdict *v, enum kind kind, double error, double bound)
{
    double share = isnan(error) ? (double)INFINITY : error / bound;
    if (share >= v->share[kind]) {
        v->share[kind] = share;
        v->error[kind] = isnan(error) ? (double)INFINITY : error;
        v->bound[kind] = bound;
    }
}

verdict judge(const kernel *one, const int32_t e_q4[BT_ELECTRODES], const kernel_case *what,
              const kernel_truth *truth)
{
    const lin2013_result *want = &truth->result;
    verdict v = {{0}, {0}, {0}};
    kernel_answer got;
    one->run(e_q4, what, &got);
    for (int d = 0; d < 3; d++) {
        raise_to(&v, KIND_FORCE, fabs(got.force_mn[d] - want->force_n[d] * 1000),
                 one->bound(KIND_FORCE, &truth->load, 0));
    }
    for (int d = 0; d < 2; d++) {
        raise_to(&v, KIND_TORQUE_YZ, fabs(got.torque_mnmm[d + 1] - want->torque_nmm[d + 1] * 1000),
                 one->bound(KIND_TORQUE_YZ, &truth->load, d));
    }
    double poc_bound = one->bound(KIND_POC, &truth->load, 0);
    double lever_bound = one->bound(KIND_TORQUE_X, &truth->load, 0);
    bool has_poc = !isnan(want->poc_mm[0]);
    if (got.has_poc != has_poc) {
        raise_to(&v, KIND_POC, (double)INFINITY, poc_bound);
    } else if (has_poc) {
        double square = 0;
        for (int d = 0; d < 3; d++) {
            double error = got.poc_um[d] - want->poc_mm[d] * 1000;
            square += error * error;
        }
        raise_to(&v, KIND_POC, sqrt(square), poc_bound);
        raise_to(&v, KIND_TORQUE_X, fabs(got.torque_mnmm[0] - want->torque_nmm[0] * 1000), lever_bound);
    }
    return v;
}
