// The exact int64 kernels against the double reference: they judge the shipped ones, so they are
// judged first. Bounds: the PoC is rounded to nm and its root is off by 2^-29 of 5.08 mm; force is
// rounded to uN; the torque's sum is rounded to 1/16 count*um before its gain, then to mN*mm.
#include "support.h"

#include "exact.h"
#include "lin2013.h"

#include <math.h>

#define GAIN_MAX_NN 100000000

static void check(const int32_t e_q4[BT_ELECTRODES], int weights, const int32_t force_nn[3],
                  const int32_t torque_nn[2])
{
    lin2013_settings settings = {.poc_weights = weights};
    lin2013_result want;
    double e[BT_ELECTRODES];
    int32_t poc_nm[3];
    int64_t force_un[3], torque_mnmm[2];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = e_q4[i] / 16.0;
    }
    for (int d = 0; d < 3; d++) {
        settings.force_gain[d] = force_nn[d] * 1e-9;
        settings.torque_gain[d % 2] = torque_nn[d % 2] * 1e-9;
    }
    lin2013(e, &settings, &want);
    exact_force_un(e_q4, force_nn, force_un);
    exact_torque_yz_mnmm(e_q4, torque_nn, torque_mnmm);
    for (int d = 0; d < 3; d++) {
        assert_true(fabs((double)force_un[d] - want.force_n[d] * 1e6) <= 0.5 + 1e-3);
    }
    for (int d = 0; d < 2; d++) {
        double rounded_sum = 0.5 / 16 * fabs(settings.torque_gain[d]);
        assert_true(fabs((double)torque_mnmm[d] - want.torque_nmm[d + 1] * 1e3) <= 0.5 + rounded_sum + 1e-6);
    }
    if (!exact_poc(e_q4, weights, poc_nm)) {
        assert_true(isnan(want.poc_mm[0]));
        return;
    }
    for (int d = 0; d < 3; d++) {
        assert_true(fabs(poc_nm[d] - want.poc_mm[d] * 1e6) <= 0.6);
    }
    double size = fabs(want.force_n[1]) + fabs(want.force_n[2]);
    double error = fabs((double)exact_torque_x_mnmm(poc_nm, force_un) - want.torque_nmm[0] * 1e3);
    assert_true(error <= 0.5 + 2 * 5.08 * 0.5e-3 + 0.6e-3 * size + 1e-6);
}

static void exact_is_the_reference_to_its_rounding(void **state)
{
    (void)state;
    uint64_t seed = 21;
    for (int k = 0; k < 60000; k++) {
        int32_t e[BT_ELECTRODES], force_nn[3], torque_nn[2];
        int64_t size = BT_E_MAX_Q4 >> (k % 16);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e[i] = k % 7 ? (int32_t)random_range(&seed, -size, size)
                         : (k >> (i % 12) & 1 ? 1 : -1) * BT_E_MAX_Q4;
        }
        for (int d = 0; d < 3; d++) {
            force_nn[d] = (int32_t)random_range(&seed, -GAIN_MAX_NN, GAIN_MAX_NN);
            torque_nn[d % 2] = (int32_t)random_range(&seed, -GAIN_MAX_NN, GAIN_MAX_NN);
        }
        check(e, k % 3, force_nn, torque_nn);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exact_is_the_reference_to_its_rounding),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
