#include "grip_parts.h"

#include <math.h>

void grip_parts(const double poc_mm[3], const double force_n[3], double part_n[2])
{
    double outward[3] = {poc_mm[0] > 0 ? poc_mm[0] : 0, poc_mm[1], poc_mm[2]};
    double length = sqrt(outward[0] * outward[0] + outward[1] * outward[1] + outward[2] * outward[2]);
    double along = 0, square = 0;
    for (int d = 0; d < 3; d++) {
        outward[d] /= length;
        along += force_n[d] * outward[d];
    }
    for (int d = 0; d < 3; d++) {
        double across = force_n[d] - along * outward[d];
        square += across * across;
    }
    part_n[0] = along > 0 ? 0 : -along; // a NaN stays
    part_n[1] = sqrt(square);
}
