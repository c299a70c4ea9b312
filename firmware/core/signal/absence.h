// How long a finger was silent, or had too few good words, and the counts on return.
//
// Unit: device time, which every FRAME carries: a recording lacks the silent rounds and still recomputes bit
// for bit. A silence of more than 71 minutes wraps and looks shorter.
#ifndef BIOTAC_ABSENCE_H
#define BIOTAC_ABSENCE_H

#include "signal/trigger.h"

// Rounds that measure the counts after a silence: results are good 50 ms after the first.
#define BT_SILENCE_ROUNDS 5

typedef struct {
    uint32_t last_us; // device time of the last round that was used
    uint16_t sweeps;  // length of the latest silence, in sweeps of 80 ms; 0: none
    uint8_t rounds;   // since the silence ended
    bt_lanes sum;     // the filtered counts of these rounds, added
} bt_silence;

// Add a usable round's filtered counts. Returns true in the last of the rounds that follow a silence of at
// least one sweep; `sweeps` and `sum` are then good until the next call.
bool bt_silence_add(bt_silence *silence, uint32_t t_us, const bt_lanes *smooth);

#endif
