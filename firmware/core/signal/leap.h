// What no living sensor's words do from one round to the next; they are another channel's or sensor's, or the
// supply's. A temperature does not leap. A blow that moves the skin far is heard: of real fingers, tapped,
// what all electrodes moved by in sum, and four times pressure, was up to 11 times the swing of PAC. And no
// blow moves all electrodes one way and alike, and pressure not: of real fingers, pressed and sheared on
// plates, in each round that moved them one way so far, one moved by over four times the mean.
//
// The next round has to confirm it, because a glitch is one round's.
//
// Units: counts.
#ifndef BIOTAC_LEAP_H
#define BIOTAC_LEAP_H

#include "signal/trigger.h"

typedef struct {
    uint16_t pac[BT_PAC_PER_FRAME]; // of the round before
    uint32_t read;                  // lanes whose words of the round before were used
    uint16_t swing; // below which PAC is too quiet for how far they leapt in it; 0: not too far
    bool alike;     // they leapt in it, all alike
    bool tdc_leapt; // in it
    uint16_t tdc;   // of the latest round in which it did not; 0: unknown
} bt_leap;

// End a round: an enum bt_sensor_fault. What moved while nothing was read did not leap: memset to 0 then.
uint8_t bt_leap_round(bt_leap *leap, const bt_round *round, const bt_trigger *trigger);

#endif
