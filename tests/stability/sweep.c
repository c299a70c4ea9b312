#include "sweep.h"

#include "frames.h"

#include <math.h>

#define START_MM   (-13.0)
#define END_MM     4.5
#define WIDTH_MM   3.0
#define TOP_COUNTS 3000 // large, so that rounding the signals explains little

// The steepest that projecting the centre onto the surface can be: radius over the least distance of any
// centre from the axis, which is that of the electrode nearest to it.
#define STEEPEST ((double)BT_CORE_RADIUS_UM / -BT_ELECTRODE_Z_MAX_UM)

static double weight(double e, int weights)
{
    double size = weights != BT_POC_WEIGHTS_ABS_N2 && e > 0 ? 0 : fabs(e);
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? size : size * size;
}

// How far rounding each signal by up to half a sixteenth can move the point: each weight changes by dw at
// most, and the centre by no more than sum dw |r - c| / (W - sum dw).
static double rounding_um(const double e[BT_ELECTRODES], const lin2013_result *truth, int weights)
{
    double total = 0, moved = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double half = 0.5 / 16, square = 0;
        double change = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? half : 2 * fabs(e[i]) * half + half * half;
        for (int d = 0; d < 3; d++) {
            double away = bt_electrode_um[i][d] - 1000 * truth->centroid_mm[d];
            square += away * away;
        }
        total += weight(e[i], weights) - change;
        moved += change * sqrt(square);
    }
    return STEEPEST * moved / total;
}

static double distance_um(const double a[3], const double b[3])
{
    double square = 0;
    for (int d = 0; d < 3; d++) {
        square += (a[d] - b[d]) * (a[d] - b[d]);
    }
    return sqrt(square);
}

sweep_outcome sweep(const kernel *one, const kernel_case *what, double angle, double step_um)
{
    sweep_outcome out = {0};
    lin2013_settings settings = {.poc_weights = what->weights};
    kernel_load none = {0};
    double last_um[3] = {0}, last_true_um[3] = {0}, last_bound = 0;
    int64_t steps = (int64_t)((END_MM - START_MM) * 1000 / step_um);
    for (int64_t k = 0; k <= steps; k++) {
        double x_mm = START_MM + (double)k * step_um / 1000;
        double at_mm[3], e[BT_ELECTRODES], true_um[3];
        int32_t e_q4[BT_ELECTRODES];
        lin2013_result truth;
        kernel_answer got;
        on_core(x_mm, angle, at_mm);
        press(at_mm, WIDTH_MM, TOP_COUNTS, e);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e_q4[i] = (int32_t)lround(16 * e[i]);
        }
        lin2013(e, &settings, &truth);
        one->run(e_q4, what, &got);
        for (int d = 0; d < 3; d++) {
            true_um[d] = 1000 * truth.poc_mm[d];
        }
        out.on_cap += truth.poc_mm[0] > 0;
        out.on_cylinder += truth.poc_mm[0] <= 0;
        double bound = one->bound(KIND_POC, &none, 0) + rounding_um(e, &truth, what->weights);
        if (k > 0) {
            double step = distance_um(got.poc_um, last_um);
            double true_step = distance_um(true_um, last_true_um);
            double share = (step - true_step) / (bound + last_bound);
            // Written so that a point that is no number is an excess.
            if (!(share <= out.largest_excess)) {
                out.largest_excess = isnan(share) ? (double)INFINITY : share;
                out.excess_at_x_mm = x_mm;
                out.excess_um = step - true_step;
                out.excess_bound_um = bound + last_bound;
            }
            if (!(step <= out.largest_step_um)) {
                out.largest_step_um = step;
                out.true_step_um = true_step;
            }
            out.steps++;
        }
        for (int d = 0; d < 3; d++) {
            last_um[d] = got.poc_um[d];
            last_true_um[d] = true_um[d];
        }
        last_bound = bound;
    }
    return out;
}
