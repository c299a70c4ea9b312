#include "errors.h"

#include "variants.h"

#include <math.h>
#include <string.h>

_Static_assert(BT_SUM_SQUARES_R_MAX_Q8_UM <= INT64_MAX && BT_SUM_ARM_MAX_Q4_NM <= INT64_MAX,
               "the judge's sums must be exact");

typedef struct {
    long double poc_um[3];
    long double force_mn[3];
    long double torque_mnmm[3];
    bool has_poc;
} verdict;

static int64_t weight(int64_t e, int weights)
{
    if (weights == BT_POC_WEIGHTS_ABS_N2) {
        return e * e;
    }
    int64_t compressed = e < 0 ? -e : 0;
    return weights == BT_POC_WEIGHTS_COMPRESS_N2 ? compressed * compressed : compressed;
}

static void judge_point(const int32_t e_q4[BT_ELECTRODES], int weights, verdict *out)
{
    int64_t total = 0;
    int64_t moment[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int64_t w = weight(e_q4[i], weights);
        total += w;
        for (int d = 0; d < 3; d++) {
            moment[d] += w * bt_electrode_um[i][d];
        }
    }
    out->has_poc = total > 0;
    if (!out->has_poc) {
        return;
    }
    long double x = (long double)moment[0];
    long double y = (long double)moment[1];
    long double z = (long double)moment[2];
    bool tip = moment[0] > 0;
    long double length = sqrtl((tip ? x * x : 0) + y * y + z * z);
    out->poc_um[0] = tip ? x * BT_CORE_RADIUS_UM / length : x / (long double)total;
    out->poc_um[1] = y * BT_CORE_RADIUS_UM / length;
    out->poc_um[2] = z * BT_CORE_RADIUS_UM / length;
}

static verdict judge(const int32_t e_q4[BT_ELECTRODES], const bt_kernel_case *what)
{
    verdict out;
    memset(&out, 0, sizeof out);
    int64_t normal[3] = {0, 0, 0};
    int64_t arm[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int d = 0; d < 3; d++) {
            normal[d] += (int64_t)e_q4[i] * bt_normal_milli[i][d];
            arm[d] += (int64_t)e_q4[i] * bt_arm_nm[i][d];
        }
    }
    for (int d = 0; d < 3; d++) { // 1/16 count * 1/1000 * nN
        out.force_mn[d] = (long double)(normal[d] * what->force_nn[d]) / 16e9L;
    }
    for (int d = 1; d < 3; d++) { // 1/16 count * nm * nN
        out.torque_mnmm[d] = (long double)arm[d] * what->torque_nn[d - 1] / 16e12L;
    }
    judge_point(e_q4, what->poc_weights, &out);
    out.torque_mnmm[0] = (out.poc_um[1] * out.force_mn[2] - out.poc_um[2] * out.force_mn[1]) / 1000;
    return out;
}

// A point's error is one distance. Force and torque are given axis by axis, and so are their bounds: theirs
// is that of the axis that is furthest off.
static double distance(const double got[3], const long double want[3])
{
    long double square = 0;
    for (int d = 0; d < 3; d++) {
        long double off = (long double)got[d] - want[d];
        square += off * off;
    }
    return (double)sqrtl(square);
}

static double furthest_axis(const double got[3], const long double want[3], int first)
{
    long double furthest = 0;
    for (int d = first; d < 3; d++) {
        furthest = fmaxl(furthest, fabsl((long double)got[d] - want[d]));
    }
    return (double)furthest;
}

static void errors_of(const variant *one, const variant_settings *settings, const bt_kernel_case *what,
                      const int32_t e_q4[BT_ELECTRODES], double errors[BT_KERNEL_ERRORS])
{
    variant_output output;
    variant_result got;
    memset(&output, 0, sizeof output);
    verdict want = judge(e_q4, what);
    bool has_poc = one->run(e_q4, settings, VARIANT_ALL, &output);
    one->read(&output, &got);
    errors[1] = furthest_axis(got.force_mn, want.force_mn, 0);
    errors[2] = furthest_axis(got.torque_mnmm, want.torque_mnmm, 1);
    if (has_poc && want.has_poc) {
        errors[0] = distance(got.poc_um, want.poc_um);
        errors[3] = (double)fabsl((long double)got.torque_mnmm[0] - want.torque_mnmm[0]);
    } else {
        errors[0] = errors[3] = has_poc == want.has_poc ? (double)NAN : (double)INFINITY;
    }
}

static variant_settings settings_of(const bt_kernel_case *what)
{
    variant_settings settings;
    variant_settings_init(&settings, what->poc_weights, what->force_nn, what->torque_nn);
    return settings;
}

int bt_kernel_variants(void)
{
    return VARIANTS;
}

const char *bt_kernel_name(int variant)
{
    return variants[variant].name;
}

void bt_kernel_errors(int variant, const bt_kernel_case *what, int64_t n, const int32_t *e_q4, double *errors)
{
    variant_settings settings = settings_of(what);
    for (int64_t k = 0; k < n; k++) {
        errors_of(&variants[variant], &settings, what, e_q4 + k * BT_ELECTRODES,
                  errors + k * BT_KERNEL_ERRORS);
    }
}

int64_t bt_kernel_run(int variant, const bt_kernel_case *what, int64_t n, const int32_t *e_q4)
{
    variant_settings settings = settings_of(what);
    int64_t points = 0;
    for (int64_t k = 0; k < n; k++) {
        variant_output output;
        points += variants[variant].run(e_q4 + k * BT_ELECTRODES, &settings, VARIANT_ALL, &output);
    }
    return points;
}

// xorshift64*
static uint64_t draw(uint64_t *state, uint64_t below)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return (*state * 0x2545F4914F6CDD1Dull >> 16) % below;
}

static int32_t draw_signal(uint64_t *state)
{
    int32_t size = (int32_t)draw(state, (uint64_t)(BT_E_MAX_Q4 >> draw(state, 17)) + 1);
    return draw(state, 3) ? -size : size;
}

static int32_t within(int64_t e)
{
    return (int32_t)(e > BT_E_MAX_Q4 ? BT_E_MAX_Q4 : e < -BT_E_MAX_Q4 ? -BT_E_MAX_Q4 : e);
}

static void change(uint64_t *state, int32_t e_q4[BT_ELECTRODES])
{
    int32_t *e = &e_q4[draw(state, BT_ELECTRODES)];
    switch (draw(state, 6)) {
    case 0:
        *e = draw_signal(state);
        break;
    case 1:
        *e = within(*e + (int64_t)draw(state, 3) - 1);
        break;
    case 2:
        *e = within(*e + ((int64_t)draw(state, 513) - 256));
        break;
    case 3:
        *e = draw(state, 2) ? -*e : 0;
        break;
    case 4:
        *e = draw(state, 2) ? -BT_E_MAX_Q4 : BT_E_MAX_Q4;
        break;
    default: // all of them, a little larger or smaller
        for (int i = 0, scale = 896 + (int)draw(state, 257); i < BT_ELECTRODES; i++) {
            e_q4[i] = within((int64_t)e_q4[i] * scale / 1024);
        }
    }
}

double bt_kernel_climb(int variant, const bt_kernel_case *what, int kind, uint64_t seed, int restarts,
                       int steps)
{
    variant_settings settings = settings_of(what);
    uint64_t state = seed * 0x9E3779B97F4A7C15ull + 1;
    double worst = 0;
    for (int restart = 0; restart < restarts; restart++) {
        int32_t here[BT_ELECTRODES];
        double height = -1;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            here[i] = draw(&state, 4) ? draw_signal(&state) : 0;
        }
        for (int step = 0; step < steps; step++) {
            int32_t next[BT_ELECTRODES];
            double errors[BT_KERNEL_ERRORS];
            memcpy(next, here, sizeof next);
            if (step > 0) {
                change(&state, next);
            }
            errors_of(&variants[variant], &settings, what, next, errors);
            if (isfinite(errors[kind]) && errors[kind] >= height) {
                height = errors[kind];
                memcpy(here, next, sizeof here);
            }
        }
        worst = height > worst ? height : worst;
    }
    return worst;
}
