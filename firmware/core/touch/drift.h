// Drift that all electrodes share: a real sensor's is one rate, times .82 to 1.16 for each of them, and lasts
// for minutes. It is learned while the static pressure says that nothing is pressed any harder, and is taken
// to go on for a while where nothing can be seen of it: in the first seconds of a touch, and while the finger
// is silent.
//
// Units: counts in 1/65536 (q16) and 1/2^20 (q20); time in sweeps of 80 ms. Rounds half away from zero.
#ifndef BIOTAC_DRIFT_H
#define BIOTAC_DRIFT_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int32_t rate_q20;     // counts that every electrode gains in a sweep
    int32_t waiting_q20;  // what it was some seconds ago
    int32_t sure_q20;     // and before that: no load that is seen now was learned in it
    uint8_t since_commit; // sweeps
    uint8_t settled;      // sweeps in which the tare came to rest
    int32_t moved_q16;    // what electrodes followed by in this sweep, the sum
    uint8_t sweeps;       // it was learned in; saturates
} bt_drift;

// A sweep in which the electrodes have followed by moved_q16, and all of it was drift.
void bt_drift_learn(bt_drift *drift);

// From now on temperature is followed by itself, by so much in a sweep: that is no drift any more.
void bt_drift_cool(bt_drift *drift, int32_t warming_q16);

// A load is seen: what was learned of it is forgotten.
void bt_drift_revert(bt_drift *drift);

// It has been learned for long enough.
bool bt_drift_known(const bt_drift *drift);

// What it makes of so many sweeps.
int32_t bt_drift_over(const bt_drift *drift, uint32_t sweeps);

// So many sweeps that told nothing of it. Returns what it is taken to have made in them.
int32_t bt_drift_unseen(bt_drift *drift, uint32_t sweeps);

// What every electrode is to follow by in a sweep, this far behind.
int32_t bt_drift_step_q16(const bt_drift *drift, int32_t away_q16);

#endif
