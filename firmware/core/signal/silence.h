// A finger that was silent, or whose words were too few to be used, and has come back: how long it was away,
// and what it reads now.
//
// By device time, which every FRAME holds: so a recording, in which silent rounds are missing, is recomputed
// bit for bit. A silence of more than 71 minutes wraps, and looks shorter than it was.
#ifndef BIOTAC_SILENCE_H
#define BIOTAC_SILENCE_H

#include "signal/trigger.h"

// After it, that say what the finger reads now: results are good 50 ms after the first.
#define BT_SILENCE_ROUNDS 5

typedef struct {
    uint32_t last_us; // device time of the last round that was used
    uint16_t sweeps;  // of 80 ms that the latest silence lasted; 0: there was none
    uint8_t rounds;   // since it ended
    bt_lanes sum;     // of their filtered counts
} bt_silence;

// A round that is used, with its filtered counts. True in the last of the rounds after a silence of a sweep
// or more; `sweeps` and `sum` are good until the next call.
bool bt_silence_add(bt_silence *silence, uint32_t t_us, const bt_lanes *smooth);

#endif
