// What no living sensor's words do from one round to the next; they are another channel's or sensor's, or the
// supply's. A temperature does not leap. Pressure that leaps is heard: of real fingers, tapped, what all
// electrodes moved by in sum, and four times pressure, was up to 11 times the swing of PAC. And no blow moves
// all electrodes one way and alike, and pressure not: of real fingers, pressed and sheared on plates, in each
// round that moved them one way so far, one moved by over four times the mean.
//
// The next round has to confirm what electrodes do, because a glitch is one round's, and seven more what TDC
// does, because nobody else does. Until then the leap is pending, one of TDC only together with electrodes:
// a glitch is one word's. What moved while nothing was read did not leap.
//
// Units: counts.
#ifndef BIOTAC_LEAP_H
#define BIOTAC_LEAP_H

#include "signal/trigger.h"

typedef struct {
    uint32_t t_us;  // of the round before
    uint8_t rounds; // since a gap; at most BT_LEAP_ROUNDS
    uint32_t read;  // lanes whose words of it were used
    uint16_t pac[BT_PAC_PER_FRAME];
    uint16_t swing;  // below which PAC is too quiet for how far they leapt in it; 0: not too far
    bool alike;      // they leapt in it, all alike
    bool pac_active; // PAC has swung: it works
    uint16_t tdc;    // of the latest round in which it did not leap
    uint16_t pdc;    // static pressure with it
    uint8_t settled; // rounds in which it did not, less those without it; at most BT_LEAP_ROUNDS
    uint8_t off;     // rounds since
    bool pending;    // the next rounds may confirm a leap
} bt_leap;

#define BT_LEAP_ROUNDS 8

// End a round. Returns an enum bt_sensor_fault.
uint8_t bt_leap_round(bt_leap *leap, const bt_round *round, const bt_trigger *trigger);

#endif
