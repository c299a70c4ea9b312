// Drift that all electrodes share. A real sensor drifts at one rate, times 0.82 to 1.16 for each electrode,
// for minutes. The rate is learned while static pressure shows that no load changes, and assumed to go on for
// a while when drift cannot be seen: in the first seconds of a touch, and while the finger is silent.
//
// Units: counts in 1/65536 (q16) and 1/2^20 (q20); time in sweeps of 80 ms. Rounds half away from zero.
#ifndef BIOTAC_DRIFT_H
#define BIOTAC_DRIFT_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    int32_t q20;    // counts per sweep, of every electrode
    uint8_t sweeps; // learned from; saturates
} bt_drift_rate;

typedef struct {
    bt_drift_rate now;
    bt_drift_rate waiting; // the rate some seconds ago
    bt_drift_rate sure;    // the rate before that: no load seen now is in it
    uint8_t since_commit;  // sweeps
    uint8_t settled;       // sweeps since the tare was new
    int32_t moved_q16;     // the electrodes' steps in this sweep, added up
} bt_drift;

// Learn from a sweep in which the electrodes moved by moved_q16, all of it drift.
void bt_drift_learn(bt_drift *drift);

// Remove warming_q16 a sweep from the drift: from now on temperature is followed separately.
void bt_drift_remove_warming(bt_drift *drift, int32_t warming_q16);

// A load is seen: forget the rate learned from it.
void bt_drift_revert(bt_drift *drift);

// True once drift has been learned for long enough.
bool bt_drift_known(const bt_drift *drift);

// The drift of so many sweeps.
int32_t bt_drift_over(const bt_drift *drift, uint32_t sweeps);

// So many sweeps showed nothing of the drift: it goes on at the sure rate. Returns the assumed drift, and
// reduces the rate.
int32_t bt_drift_unseen(bt_drift *drift, uint32_t sweeps);

// The step of every electrode in a sweep, when they are behind by away_q16.
int32_t bt_drift_step_q16(const bt_drift *drift, int32_t away_q16);

#endif
