// Lin, Fishel and Loeb 2013 in double, line for line from the formulas, with the paper's misprints corrected.
// The reference for the integer core; never built for a board.
//
// Corrections, each with its place in the paper:
//  Eq 2, cylinder   y and z lack the factor r: without it the result has length 1, not r.
//  Eq 2, x = 0      undefined there; Eq 7 counts it as sphere. Both limits agree; here the sphere is x > 0,
//                   as in Eq 2's first line.
//  Eq 3, Eq 4       the text says the normalised signal e*, the formula prints e. It is e*, signed, with
//                   compression negative, so that positive gains give the force ON the finger.
//  Eq 4, x          only E8 and E9 have an arm about x; M_x is replaced by the lever c x F.
//  III.D            "cross product of force and the moment" means r x F, as in Eq 4 itself.
//
// Units: counts for signals (double), mm, N, N*mm; gains N per count.
//
// Of signals in whole sixteenths of a count, every sum is exact, in any order: the terms are
// whole numbers of 1/256 count^2 um or larger, below 2^53 of them. Only the steps after the sums round.
#ifndef BIOTAC_LIN2013_H
#define BIOTAC_LIN2013_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdint.h>

typedef struct {
    int poc_weights;       // enum bt_poc_weights; the paper's is ABS_N2
    double force_gain[3];  // S of Eq 3, N/count
    double torque_gain[2]; // y and z, N/count
} lin2013_settings;

typedef struct {
    double poc_mm[3];     // Eq 1 and 2; NaN when all weights are 0
    double force_n[3];    // Eq 3
    double torque_nmm[3]; // x: lever, NaN without a PoC; y, z: Eq 4
} lin2013_result;

// Eq 1 and 2; Eq 3; and Eq 4 with the lever of a point and a force.
void lin2013_point(const double e[BT_ELECTRODES], int weights, double poc_mm[3]);
void lin2013_force(const double e[BT_ELECTRODES], const double gain[3], double force_n[3]);
void lin2013_torque(const double e[BT_ELECTRODES], const double gain[2], const double poc_mm[3],
                    const double force_n[3], double torque_nmm[3]);

void lin2013(const double e[BT_ELECTRODES], const lin2013_settings *settings, lin2013_result *result);

// For n frames: counts (n, 19) and tare_q4 (n, 19) in 1/16 count; an electrode with BT_INVALID_COUNT in
// either has zero signal; poc_mm, force_n, torque_nmm (n, 3).
void lin2013_frames(int64_t n, const uint16_t *counts, const uint16_t *tare_q4,
                    const lin2013_settings *settings, double *poc_mm, double *force_n, double *torque_nmm);

#endif
