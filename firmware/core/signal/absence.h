// A finger that is back after being silent, or after rounds with too few good words: how long it was away,
// and what it reads now.
//
// Measured in device time, which every FRAME carries, so that a recording recomputes bit for bit although it
// lacks the silent rounds. A silence of more than 71 minutes wraps and looks shorter than it was.
#ifndef BIOTAC_ABSENCE_H
#define BIOTAC_ABSENCE_H

#include "signal/trigger.h"

// Rounds after a silence that tell what the finger reads now: results are good 50 ms after the first.
#define BT_SILENCE_ROUNDS 5

typedef struct {
    uint32_t last_us; // device time of the last round that was used
    uint16_t sweeps;  // length of the latest silence, in sweeps of 80 ms; 0: there was none
    uint8_t rounds;   // since it ended
    bt_lanes sum;     // of these rounds' filtered counts
} bt_silence;

// Add a usable round's filtered counts. Returns true in the last of the rounds that follow a silence of at
// least one sweep; `sweeps` and `sum` are then good until the next call.
bool bt_silence_add(bt_silence *silence, uint32_t t_us, const bt_lanes *smooth);

#endif
