// Every kernel variant against the double reference, each within a bound that follows from its arithmetic.
//
//  double      is the reference, read back.
//  gold        PoC and force rounded to nm and uN; torque to mN*mm, its sum to 1/16 count*um.
//  float       a sum of 19 rounded products is off by at most 26 half units of 2^-23 of the sum of their
//              magnitudes (19 additions, the products, the coefficient, the gain and the last steps); a
//              centroid's error is magnified by up to r / 1.116 mm by the projection.
//  int + FPU   PoC to 1/16 um per axis; conversions, root, quotient: 12 half units of 2^-23 of 13.6 mm;
//              weights cut at 2^-29 of the largest: 18 of them, 19.4 mm of span, magnified. Force as shipped:
//              0.05 mN and half a unit of 2^-34 on the largest sum. Torque: half a mN*mm, half a unit of
//              2^-36 on the largest sum, half of 4096 nm/16 of arm.
//  Q15         signals cut by 1/16 count and products by 1/8 count, coefficients to 2^-15, gains to 2^-11.
#include "support.h"

#include "variants.h"

#include <math.h>

#define SQRT3     1.7320508075688772
#define MAGNIFIED (5080.0 / 1116)
#define HALF_UNIT (1.0 / 16777216)

#define FLOAT_SUM    (26 * HALF_UNIT)
#define FLOAT_POC_UM (SQRT3 * 13600 * FLOAT_SUM * MAGNIFIED)
#define FPU_FLOAT_UM (13600 * 12 * HALF_UNIT + 18 * 19400 * MAGNIFIED / 536870912)
#define FPU_POC_UM   (SQRT3 / 16 + FPU_FLOAT_UM)
#define FPU_FORCE_MN (0.05 + 0.0024)
#define FPU_TORQUE   (0.5 + 0.0083)

static const int32_t force_nn[3] = {1063440, -252325, 2262234};
static const int32_t torque_nn[2] = {2262234, -252325};

typedef struct {
    double poc_um;         // distance
    double force_mn[3];    // per axis
    double torque_mnmm[3]; // per axis
} bounds;

static const variant *named(const char *name)
{
    for (int v = 0; v < VARIANTS; v++) {
        if (strcmp(variants[v].name, name) == 0) {
            return &variants[v];
        }
    }
    fail_msg("no variant %s", name);
    return NULL;
}

static void reference(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings,
                      lin2013_result *want, double *size)
{
    double e[BT_ELECTRODES];
    *size = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = e_q4[i] / 16.0;
        *size += fabs(e[i]);
    }
    lin2013(e, &settings->real64, want);
}

// Where a gain is left out it is 1 N per count: these are errors of sums, in count and count*um.
static bounds bounds_of(const char *name, double size)
{
    if (strcmp(name, "double") == 0) {
        return (bounds){0, {0, 0, 0}, {0, 0, 0}};
    }
    if (strcmp(name, "gold int64") == 0) {
        return (bounds){0.001 * SQRT3, {0, 0, 0}, {0, 1.0 / 32, 1.0 / 32}};
    }
    if (strncmp(name, "float", 5) == 0) {
        double arm = 13600 * size * FLOAT_SUM;
        return (bounds){FLOAT_POC_UM, {size * FLOAT_SUM, size * FLOAT_SUM, size * FLOAT_SUM}, {0, arm, arm}};
    }
    if (strcmp(name, "int + FPU") == 0) {
        return (bounds){FPU_POC_UM, {0, 0, 0}, {0, 0.129, 0.129}};
    }
    double cut = 19 / 8.0 + 19 / 16.0 + size / 32768;
    double full = 13600 * cut;
    return (bounds){INFINITY, {cut, cut, cut}, {0, full, full}};
}

static double output_mn(const char *name)
{
    return strcmp(name, "gold int64") == 0  ? 0.0005
           : strcmp(name, "int + FPU") == 0 ? FPU_FORCE_MN
           : strcmp(name, "Q15") == 0       ? 0.1
                                            : 0;
}

static double output_mnmm(const char *name)
{
    return strcmp(name, "gold int64") == 0  ? 0.5
           : strcmp(name, "int + FPU") == 0 ? FPU_TORQUE
           : strcmp(name, "Q15") == 0       ? 1
                                            : 0;
}

static void check_wrench(const variant *one, const variant_result *got, const lin2013_result *want,
                         double size)
{
    bounds allowed = bounds_of(one->name, size);
    double relative = strcmp(one->name, "Q15") == 0 ? 1.0 / 1024 : 1e-9;
    for (int d = 0; d < 3; d++) {
        double gain_mn = fabs(force_nn[d] * 1e-6);
        double bound =
            gain_mn * allowed.force_mn[d] + output_mn(one->name) + relative * fabs(want->force_n[d] * 1e3);
        assert_true(fabs(got->force_mn[d] - want->force_n[d] * 1e3) <= bound + 1e-9);
    }
    for (int d = 1; d < 3; d++) {
        double gain_n = fabs(torque_nn[d - 1] * 1e-9);
        double bound = gain_n * allowed.torque_mnmm[d] + output_mnmm(one->name)
                       + relative * fabs(want->torque_nmm[d] * 1e3);
        assert_true(fabs(got->torque_mnmm[d] - want->torque_nmm[d] * 1e3) <= bound + 1e-9);
    }
}

static void check_point(const variant *one, const variant_result *got, const lin2013_result *want,
                        double size)
{
    bounds allowed = bounds_of(one->name, size);
    double square = 0;
    for (int d = 0; d < 3; d++) {
        double off = got->poc_um[d] - want->poc_mm[d] * 1e3;
        square += off * off;
    }
    assert_true(sqrt(square) <= allowed.poc_um + 1e-9);
    double arm = 0; // what the forces' own errors make of the lever
    for (int d = 1; d < 3; d++) {
        arm += 5.08 * (fabs(force_nn[d] * 1e-6) * allowed.force_mn[d] + output_mn(one->name));
    }
    double force_n = fabs(want->force_n[1]) + fabs(want->force_n[2]);
    // the point that an integer variant publishes is rounded after the lever was taken
    double point_um = strcmp(one->name, "int + FPU") == 0 ? FPU_FLOAT_UM : allowed.poc_um;
    double lever = force_n * (point_um + 5080 * 6 * HALF_UNIT) + output_mnmm(one->name) + arm;
    assert_true(fabs(got->torque_mnmm[0] - want->torque_nmm[0] * 1e3) <= lever + 1e-9);
}

static void check_frame(const int32_t e_q4[BT_ELECTRODES])
{
    for (int weights = 0; weights <= 2; weights++) {
        variant_settings settings;
        variant_settings_init(&settings, weights, force_nn, torque_nn);
        lin2013_result want;
        double size;
        reference(e_q4, &settings, &want, &size);
        for (int v = 0; v < VARIANTS; v++) {
            const variant *one = &variants[v];
            if (strcmp(one->name, "shipped") == 0) {
                continue; // test_kernels.c has its bounds
            }
            variant_output output;
            variant_result got;
            memset(&output, 0, sizeof output);
            bool has_poc = one->run(e_q4, &settings, VARIANT_ALL, &output);
            one->read(&output, &got);
            check_wrench(one, &got, &want, size);
            bool expected = !isnan(want.poc_mm[0]);
            if (strcmp(one->name, "Q15") == 0) {
                assert_true(expected || !has_poc); // it may have none where there is one
            } else {
                assert_int_equal(has_poc, expected);
                if (has_poc) {
                    check_point(one, &got, &want, size);
                }
            }
        }
    }
}

static void every_variant_is_within_its_bound(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int k = 0; k < 40000; k++) {
        int32_t e_q4[BT_ELECTRODES];
        int64_t top = BT_E_MAX_Q4 >> random_range(&seed, 0, 16);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e_q4[i] = k % 3 && random_range(&seed, 0, 3) ? 0 : (int32_t)random_range(&seed, -top, top);
        }
        check_frame(e_q4);
    }
}

static void the_ends_of_the_range_are_within_the_bounds(void **state)
{
    (void)state;
    uint64_t seed = 6;
    for (int k = 0; k < 20000; k++) {
        int32_t e_q4[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            // 2048 counts is where the int + FPU variant sums its squares again
            static const int32_t ends[] = {-BT_E_MAX_Q4, BT_E_MAX_Q4, 0, -32768, -32767, 1, -1};
            e_q4[i] = ends[random_range(&seed, 0, 6)];
        }
        check_frame(e_q4);
    }
}

static void no_weight_is_no_point_for_any_variant(void **state)
{
    (void)state;
    int32_t nothing[BT_ELECTRODES] = {0};
    int32_t bulge[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bulge[i] = 1 + 3000 * i;
    }
    for (int weights = 0; weights <= 2; weights++) {
        variant_settings settings;
        variant_settings_init(&settings, weights, force_nn, torque_nn);
        for (int v = 0; v < VARIANTS; v++) {
            variant_output output;
            assert_false(variants[v].run(nothing, &settings, VARIANT_ALL, &output));
            bool counts = weights == BT_POC_WEIGHTS_ABS_N2;
            assert_int_equal(variants[v].run(bulge, &settings, VARIANT_ALL, &output), counts);
        }
    }
}

static void a_part_is_what_the_whole_has(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (int k = 0; k < 2000; k++) {
        int32_t e_q4[BT_ELECTRODES];
        variant_settings settings;
        variant_settings_init(&settings, k % 3, force_nn, torque_nn);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e_q4[i] = (int32_t)random_range(&seed, -BT_E_MAX_Q4, BT_E_MAX_Q4);
        }
        for (int v = 0; v < VARIANTS; v++) {
            variant_output whole, point, force, torque;
            variant_result all, one;
            assert_true(variants[v].run(e_q4, &settings, VARIANT_ALL, &whole));
            assert_true(variants[v].run(e_q4, &settings, VARIANT_POC, &point));
            assert_true(variants[v].run(e_q4, &settings, VARIANT_FORCE, &force));
            assert_true(variants[v].run(e_q4, &settings, VARIANT_TORQUE, &torque));
            variants[v].read(&whole, &all);
            variants[v].read(&point, &one);
            assert_memory_equal(one.poc_um, all.poc_um, sizeof all.poc_um);
            variants[v].read(&force, &one);
            assert_memory_equal(one.force_mn, all.force_mn, sizeof all.force_mn);
            variants[v].read(&torque, &one);
            assert_memory_equal(one.torque_mnmm, all.torque_mnmm, sizeof all.torque_mnmm);
        }
    }
}

static void the_variant_for_an_fpu_is_finer_than_what_is_shipped(void **state)
{
    (void)state;
    assert_true(FPU_POC_UM <= 0.4);
    assert_ptr_equal(named("int + FPU")->run, variant_fpu);
    assert_ptr_equal(named("shipped")->run, variant_shipped);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_variant_is_within_its_bound),
        cmocka_unit_test(the_ends_of_the_range_are_within_the_bounds),
        cmocka_unit_test(no_weight_is_no_point_for_any_variant),
        cmocka_unit_test(a_part_is_what_the_whole_has),
        cmocka_unit_test(the_variant_for_an_fpu_is_finer_than_what_is_shipped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
