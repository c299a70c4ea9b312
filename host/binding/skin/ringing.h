// The effect of sliding skin on dynamic pressure: host/biotac/sim/stick_slip.py has the law and the numbers.
#ifndef BIOTAC_RINGING_H
#define BIOTAC_RINGING_H

#include "wire/sensor_gen.h"

#include <stdint.h>

enum { BT_RING_SAMPLES = 110 }; // of PAC after a blow: ten times the ring's time constant

typedef struct {
    double ring[BT_RING_SAMPLES]; // after a blow of 1
    double amplitude_counts, drawn_mm, pac_hz;

    // From round to round: the blows that still ring, and room for a round's.
    double blow[BT_RING_SAMPLES - 1 + BT_PAC_PER_FRAME];
    uint8_t slid;
} bt_ringing;

// PAC counts above rest of n rounds, 22 each, of skin that slides at a speed a round. draws: two numbers of 0
// to 1 for each sample of PAC.
void bt_ring(bt_ringing *ringing, int64_t n, const double *speed_mm_s, const double *draws, double *counts);

#endif
