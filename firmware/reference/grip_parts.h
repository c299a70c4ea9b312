// The parts of a force that solve/interval.h computes on boards, in double.
#ifndef BIOTAC_GRIP_PARTS_H
#define BIOTAC_GRIP_PARTS_H

// Normal and shear of force_n on the finger at poc_mm, in N: along the skin's inward normal, 0 where the
// force would pull, and across it. NaN where the point is NaN.
void grip_parts(const double poc_mm[3], const double force_n[3], double part_n[2]);

#endif
