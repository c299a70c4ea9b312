// A contact moved over the surface in steps of micrometres: what is published may jump by no more than the
// point itself, as the formulas in double give it for signals that nothing has rounded.
#ifndef BIOTAC_STRESS_SWEEP_H
#define BIOTAC_STRESS_SWEEP_H

#include "kernels.h"

typedef struct {
    int64_t steps;
    double largest_step_um; // published
    double true_step_um;    // the geometry's own, at that place
    double largest_excess;  // published step less the geometry's, as share of what rounding explains
    double excess_at_x_mm, excess_um, excess_bound_um;
    int64_t on_cap, on_cylinder;
} sweep_outcome;

// From the proximal end over the seam to the tip, at one angle about the axis.
sweep_outcome sweep(const kernel *one, const kernel_case *what, double angle, double step_um);

#endif
