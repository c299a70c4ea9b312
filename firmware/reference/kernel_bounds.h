// How far the shipped kernel's results may be from the formulas in double (firmware/reference/lin2013.h).
// Checked by tests/core/solve/test_kernels.c frame by frame, by tests/fuzz and by `biotac check`; parts are
// proved in tests/proofs (host/docs/develop/testing.md, Arithmetic).
//
// Where the bounds come from (nothing is tuned):
//  PoC    Rounding to um: 0.5 per axis. Rounding direction components to 16 bits: 2^-16 of r per axis.
//         Their reciprocal length, along the radius: a chord within 2^-17.4 of the curve, and two units of
//         17 bits (one from the table, one from halving) of at least 75000. Cutting components at the
//         radius to 20 bits: 2^-20 of r per axis, and to be safe as much again for the share. Cutting
//         squares at 2^-21 of the largest: |N| is at least 1116 um of that, and less than one unit is lost
//         per electrode, together at most (107.8, 27.3, 57.3) mm: 0.28 um for the worst frame. Linear
//         weights are exact, and so is the division by W.
//  force  0.05 mN, and the multiplier's half unit of 2^-34 on the largest sum: 0.0024 mN.
//  torque y, z: 0.5 mN*mm; arms rounded to 1/256 of 3.2 um: T sum |e| / 160 um; less than two units cut:
//         0.4 T; the multiplier: half of 2^-35 of the sum in units of 0.2 count*um.
//  torque x: 0.5 mN*mm, and 1/16 where products are cut; a force error of 0.0524 mN on 5.08 mm in y and z;
//         a point error times the force: 1/16 um (half of the 0.04 um by which the middle of a cut may be
//         off, and half of the lever's unit of 0.08 um) and the error of the PoC's direction.
#ifndef BIOTAC_KERNEL_BOUNDS_H
#define BIOTAC_KERNEL_BOUNDS_H

#define SQRT_3         1.7320508075688772
#define LENGTH_UM      (5080 * (5.8e-6 + 2.0 / 75000))
#define DIRECTION_UM   (SQRT_3 * 5080 / 65536 + LENGTH_UM + SQRT_3 * 5080 / 524288 + 0.28)
#define POC_BOUND_UM   (0.5 * SQRT_3 + DIRECTION_UM)
#define FORCE_BOUND_MN (0.05 + 0.0024)

// size: sum |e| in count; gain_n: N/count, not negative; sum: of Eq 4, count*um, not negative. The last term
// is the error of the double itself.
static inline double torque_yz_bound_mnmm(double size, double gain_n, double sum)
{
    return 0.5 + gain_n * (size / 160 + 0.4) + sum * 5 / 68719476736.0 + 1e-6;
}

// force: |F_y| + |F_z| in N.
static inline double torque_x_bound_mnmm(double force)
{
    return 0.5 + 0.0625 + 2 * 5.08 * FORCE_BOUND_MN + force * (0.0625 + DIRECTION_UM);
}

#endif
