// How far the shipped kernel's results may be from the formulas in double (firmware/reference/lin2013.h).
// Held by tests/core/test_kernels.c frame by frame and by tests/fuzz; parts are proved in tests/proofs.
//
// Where the bounds come from (nothing is tuned):
//  PoC    the published um: 0.5 per axis. Direction components of 16 bits, rounded: 2^-16 of r per
//         axis. Their length to half a unit of at least 2^15: 2^-16 of r along the radius. x on the
//         cylinder: 2^-18 of up to 13.6 mm. Weights cut at 2^-23 of the largest, 19 of them, each
//         moving the centroid by at most 19.4 mm of span and the projection magnifying it by up to
//         r / 1.116 mm: 0.2 um for the unluckiest frame.
//  force  0.05 mN, and the multiplier's half unit of 2^-34 on the largest sum: 0.0024 mN.
//  torque y, z: 0.5 mN*mm; arms rounded to 1/16 um: T sum |e| / 32 um; the sum to 1 count*um: T / 2;
//         the multiplier: 2^-34 of the sum.
//  torque x: 0.5 mN*mm, twice; force off by 0.0524 mN on 5.08 mm in y and z; point off by 1/16 um
//         (the middle of a cut) and by what the PoC's direction is, times the force.
#ifndef BIOTAC_TEST_KERNEL_BOUNDS_H
#define BIOTAC_TEST_KERNEL_BOUNDS_H

#define DIRECTION_UM   (1.7320508075688772 * 5080 / 65536 + 5080.0 / 65536 + 0.2)
#define POC_BOUND_UM   (0.5 * 1.7320508075688772 + 13600.0 / 262144 + DIRECTION_UM)
#define FORCE_BOUND_MN (0.05 + 0.0024)

// size: sum |e| in count; gain_n: N/count, not negative; sum: of Eq 4, count*um, not negative.
// The last term is what the double itself may be off.
static inline double torque_yz_bound_mnmm(double size, double gain_n, double sum)
{
    return 0.5 + gain_n * (size / 32 + 0.5) + sum / 17179869184.0 + 1e-6;
}

// force: |F_y| + |F_z| in N.
static inline double torque_x_bound_mnmm(double force)
{
    return 1 + 2 * 5.08 * FORCE_BOUND_MN + force * (0.0625 + DIRECTION_UM);
}

#endif
