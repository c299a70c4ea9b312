// Every kernel against the formulas in double, on every extreme that can be listed, on random frames in six
// classes, on frames that hill climbing drives up to the bounds, and on contacts swept over the seam.
//
//   stress_kernels [--frames N] [--seed S] [--restarts N] [--steps N] [--stride N] [--json] [--defect]
//
// --defect: with a kernel that has one, which must be found. --frames: random ones, over all classes;
// --stride: only every N-th of a list. Exit 0: every result within its bound; 1: not, and then the shortest
// frame that shows it is printed, with what is needed to repeat it.
#include "frames.h"
#include "sweep.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    int64_t frames;
    uint64_t seed;
    int64_t restarts;
    int64_t steps;
    int64_t stride;
    bool json;
    bool defect;
} options;

static options chosen = {600000, DEFAULT_SEED, 4, 4000, 1, false, false};
static bool good = true;

static const kernel_case default_gains = {1, {1063440, 252325, 2262234}, {2262234, 252325}};
static const kernel_case largest_gains = {
    1,
    {BT_SETTING_FORCE_GAIN_X_NN_MAX, -BT_SETTING_FORCE_GAIN_X_NN_MAX, BT_SETTING_FORCE_GAIN_X_NN_MAX},
    {-BT_SETTING_FORCE_GAIN_X_NN_MAX, BT_SETTING_FORCE_GAIN_X_NN_MAX}};

static const kernel *tried(int n)
{
    return chosen.defect && n == 0 ? &defective_kernel : &kernels[n];
}

// ---- what was found --------------------------------------------------------------------------------

typedef struct {
    int64_t frames;
    verdict worst;
} tally;

static double share_of(const kernel *one, const int32_t e_q4[BT_ELECTRODES], const kernel_case *what,
                       int kind)
{
    kernel_truth truth = truth_of(e_q4, what);
    return judge(one, e_q4, what, &truth).share[kind];
}

// The shortest reproduction: electrodes set to 0, then halved, as long as the result stays out of bounds.
static void shrink(const kernel *one, const kernel_case *what, int kind, int32_t e_q4[BT_ELECTRODES])
{
    for (bool smaller = true; smaller;) {
        smaller = false;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            int32_t kept = e_q4[i];
            for (int half = 0; half <= 1 && e_q4[i] == kept && kept != 0; half++) {
                e_q4[i] = half ? kept / 2 : 0;
                e_q4[i] = share_of(one, e_q4, what, kind) > 1 ? e_q4[i] : kept;
            }
            smaller = smaller || e_q4[i] != kept;
        }
    }
}

static void report_violation(const char *name, const kernel *one, const int32_t e_q4[BT_ELECTRODES],
                             const kernel_case *what, int kind)
{
    int32_t shortest[BT_ELECTRODES];
    memcpy(shortest, e_q4, sizeof shortest);
    shrink(one, what, kind, shortest);
    kernel_truth truth = truth_of(shortest, what);
    verdict v = judge(one, shortest, what, &truth);
    fprintf(stderr,
            "%s, %s: %s off by %g %s, bound %g; seed %" PRIu64 ", weights %d, gains %d %d %d %d %d nN, e_q4 ",
            name, one->name, kind_name[kind], v.error[kind], kind_unit[kind], v.bound[kind], chosen.seed,
            what->weights, what->force_nn[0], what->force_nn[1], what->force_nn[2], what->torque_nn[0],
            what->torque_nn[1]);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        fprintf(stderr, "%s%d", i ? "," : "", shortest[i]);
    }
    fprintf(stderr, "\n");
}

static void add(tally *sum, const char *name, const kernel *one, const int32_t e_q4[BT_ELECTRODES],
                const kernel_case *what, const kernel_truth *truth)
{
    verdict v = judge(one, e_q4, what, truth);
    sum->frames++;
    for (int kind = 0; kind < KINDS; kind++) {
        if (v.share[kind] > 1
            && sum->worst.share[kind] <= 1) { // the first of a case; one is enough to begin with
            report_violation(name, one, e_q4, what, kind);
            good = false;
        }
        if (v.share[kind] > sum->worst.share[kind]) {
            sum->worst.share[kind] = v.share[kind];
            sum->worst.error[kind] = v.error[kind];
            sum->worst.bound[kind] = v.bound[kind];
        }
    }
}

static void print_row(const char *name, const char *kernel_name, int64_t frames, const char *measure,
                      double value, double bound, const char *unit)
{
    if (chosen.json) {
        printf("{\"case\": \"%s\", \"kernel\": \"%s\", \"frames\": %" PRId64
               ", \"measure\": \"%s\", \"value\": %.9g, \"bound\": %.9g, \"unit\": \"%s\"}\n",
               name, kernel_name, frames, measure, value, bound, unit);
    } else {
        printf("%-28s %-8s %10" PRId64 "  %-12s %12.6g of %12.6g %s\n", name, kernel_name, frames, measure,
               value, bound, unit);
    }
    fflush(stdout);
}

static void print_tally(const char *name, const tally sums[KERNELS])
{
    for (int n = 0; n < KERNELS; n++) {
        for (int kind = 0; kind < KINDS; kind++) {
            print_row(name, tried(n)->name, sums[n].frames, kind_name[kind], sums[n].worst.error[kind],
                      sums[n].worst.bound[kind], kind_unit[kind]);
        }
    }
}

// ---- the runs --------------------------------------------------------------------------------------

static void try_frame(const char *name, tally sums[KERNELS], const int32_t e_q4[BT_ELECTRODES],
                      const kernel_case *what)
{
    kernel_truth truth = truth_of(e_q4, what);
    for (int n = 0; n < KERNELS; n++) {
        add(&sums[n], name, tried(n), e_q4, what, &truth);
    }
}

static void run_list(const frame_list *list)
{
    tally sums[KERNELS] = {{0}};
    int32_t e_q4[BT_ELECTRODES];
    for (int64_t k = 0; list->frame(k, e_q4); k += chosen.stride) {
        kernel_case what = k / 2 % 2 ? largest_gains : default_gains;
        for (what.weights = 0; what.weights <= 2; what.weights++) {
            try_frame(list->name, sums, e_q4, &what);
        }
    }
    print_tally(list->name, sums);
}

static int32_t any_gain(uint64_t *state)
{
    return (int32_t)draw_range(state, -BT_SETTING_FORCE_GAIN_X_NN_MAX, BT_SETTING_FORCE_GAIN_X_NN_MAX);
}

static kernel_case any_case(uint64_t *state)
{
    kernel_case what = default_gains;
    if (draw_range(state, 0, 3) == 0) {
        for (int d = 0; d < 3; d++) {
            what.force_nn[d] = any_gain(state);
        }
        what.torque_nn[0] = any_gain(state);
        what.torque_nn[1] = any_gain(state);
    }
    what.weights = (int)draw_range(state, 0, 2);
    return what;
}

static void run_class(const frame_class *one, int number)
{
    tally sums[KERNELS] = {{0}};
    uint64_t state = (chosen.seed + 1) * 0x9E3779B97F4A7C15ull ^ (uint64_t)number << 32;
    int64_t near = 0, total = chosen.frames / CLASSES;
    for (int64_t k = 0; k < total; k++) {
        int32_t e_q4[BT_ELECTRODES];
        kernel_case what = any_case(&state);
        one->fill(&state, what.weights, e_q4);
        near += fabs(centre_x_um(e_q4, what.weights)) < 1;
        try_frame(one->name, sums, e_q4, &what);
    }
    print_tally(one->name, sums);
    if (number == CLASSES - 1) {
        // A class that misses what it is named after would prove nothing.
        print_row(one->name, "", total, "within 1 um", (double)near, (double)total, "frames");
        good = good && near * 2 > total;
    }
}

// From frames of all classes, keep every change that does not bring the result further from its bound.
static void climb(const kernel *one, enum kind kind)
{
    char name[64];
    tally sum = {0};
    uint64_t state = (chosen.seed + 2) * 0x9E3779B97F4A7C15ull ^ (uint64_t)kind << 40;
    (void)snprintf(name, sizeof name, "climbing for %s", kind_name[kind]);
    for (int64_t restart = 0; restart < chosen.restarts * 6; restart++) {
        kernel_case what = restart / 3 % 2 ? largest_gains : default_gains;
        int32_t here[BT_ELECTRODES], next[BT_ELECTRODES];
        double height = -1;
        what.weights = (int)(restart % 3);
        classes[restart / 6 % CLASSES].fill(&state, what.weights, here);
        for (int64_t step = 0; step < chosen.steps; step++) {
            memcpy(next, here, sizeof next);
            if (step > 0) {
                change_frame(&state, next);
            }
            kernel_truth truth = truth_of(next, &what);
            double share = judge(one, next, &what, &truth).share[kind];
            if (share >= height) {
                height = share;
                memcpy(here, next, sizeof here);
            }
        }
        sum.frames += chosen.steps - 1;
        kernel_truth truth = truth_of(here, &what);
        add(&sum, name, one, here, &what, &truth);
    }
    print_row(name, one->name, sum.frames, kind_name[kind], sum.worst.error[kind], sum.worst.bound[kind],
              kind_unit[kind]);
}

static void run_sweeps(const kernel *one)
{
    static const double angles[] = {0, 0.3, -0.7, 1.2};
    sweep_outcome worst = {0};
    int64_t steps = 0;
    for (int n = 0; n < 12; n++) {
        kernel_case what = default_gains;
        what.weights = n % 3;
        sweep_outcome out = sweep(one, &what, angles[n / 3], (double)chosen.stride);
        steps += out.steps;
        // A sweep that stays on one side of the seam would prove nothing.
        good = good && out.on_cap > 500 / chosen.stride && out.on_cylinder > 500 / chosen.stride;
        if (out.largest_excess >= 1) {
            fprintf(stderr,
                    "sweep, %s: the point jumps %g um more than the geometry at x = %g mm, angle %g, weights "
                    "%d\n",
                    one->name, out.excess_um, out.excess_at_x_mm, angles[n / 3], what.weights);
            good = false;
        }
        worst = out.largest_excess > worst.largest_excess ? out : worst;
    }
    print_row("sweep over the seam", one->name, steps, "excess step", worst.excess_um, worst.excess_bound_um,
              "um");
}

// ---- command line ----------------------------------------------------------------------------------

static bool take(const char *name, const char *value)
{
    int64_t number = value ? strtoll(value, NULL, 10) : -1;
    int64_t *place = !strcmp(name, "--frames")     ? &chosen.frames
                     : !strcmp(name, "--restarts") ? &chosen.restarts
                     : !strcmp(name, "--steps")    ? &chosen.steps
                     : !strcmp(name, "--stride")   ? &chosen.stride
                                                   : NULL;
    if (number < 0) {
        return false;
    }
    if (!strcmp(name, "--seed")) {
        chosen.seed = (uint64_t)number;
        return true;
    }
    if (place == NULL || (place == &chosen.stride && number == 0)) {
        return false;
    }
    *place = number;
    return true;
}

int main(int argc, char **argv)
{
    for (int k = 1; k < argc; k++) {
        if (!strcmp(argv[k], "--json")) {
            chosen.json = true;
        } else if (!strcmp(argv[k], "--defect")) {
            chosen.defect = true;
        } else if (!take(argv[k], k + 1 < argc ? argv[k + 1] : NULL)) {
            fprintf(stderr,
                    "%s: expected --frames, --seed, --restarts, --steps, --stride and a number, --json or "
                    "--defect\n",
                    argv[k]);
            return 2;
        } else {
            k++;
        }
    }
    for (int n = 0; n < LISTS; n++) {
        run_list(&lists[n]);
    }
    for (int n = 0; n < CLASSES; n++) {
        run_class(&classes[n], n);
    }
    for (int n = 0; n < KERNELS; n++) {
        run_sweeps(tried(n));
        for (int kind = 0; kind < KINDS; kind++) {
            climb(tried(n), (enum kind)kind);
        }
    }
    return good ? 0 : 1;
}
