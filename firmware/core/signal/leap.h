// Leaps from one round to the next that no live sensor makes: of another channel or sensor, or of the supply.
// * A temperature does not leap.
// * Pressure that leaps is heard. On real fingers, tapped, the electrodes' moves in sum plus four times
// pressure were at most 11 times the swing of PAC.
// * No blow moves all electrodes one way and alike without pressure. On real fingers, pressed and sheared, in
// each round that moved all so far one way, one electrode moved over four times the mean. A glitch lasts one
// round: the next round confirms a leap of electrodes, seven more confirm one of TDC, which no other channel
// supports. Until then the leap is pending; one of TDC alone is not, as it may be one bad word. Moves across
// rounds that were not read are no leap. Units: counts.
#ifndef BIOTAC_LEAP_H
#define BIOTAC_LEAP_H

#include "signal/trigger.h"

typedef struct {
    uint32_t t_us;  // of the round before
    uint8_t rounds; // since a gap; at most BT_LEAP_ROUNDS
    uint32_t read;  // lanes that were used in that round
    uint16_t pac[BT_PAC_PER_FRAME];
    uint16_t swing;  // no blow explains the leap below this swing of PAC; 0: no such leap
    bool alike;      // all leapt in that round, and alike
    bool pac_active; // PAC has swung, so it works
    uint16_t tdc;    // of the latest round without a leap of TDC
    uint16_t pdc;    // static pressure in that round
    uint8_t settled; // rounds without a leap of TDC, less those without TDC; at most BT_LEAP_ROUNDS
    uint8_t off;     // rounds since TDC leapt
    bool pending;    // the next rounds may confirm a leap
} bt_leap;

#define BT_LEAP_ROUNDS 8

// End a round. Returns an enum bt_sensor_fault.
uint8_t bt_leap_round(bt_leap *leap, const bt_round *round, const bt_trigger *trigger);

#endif
