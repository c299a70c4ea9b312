// What a finger has read since its signals came to rest: the baseline that detects the next contact where the
// one that is subtracted from the force must stay; and what moves while nothing touches, which is drift.
//
// A load moves the static pressure, and presses some electrodes while others bulge. Drift moves nearly all
// electrodes one way while the pressure stays level. So a tare may follow what is drift by that word, even
// under a load; without pressure nothing is followed.
//
// Units: counts in 1/65536 (q16) and 1/8 (q3); time in sweeps of 80 ms.
#ifndef BIOTAC_WATCH_H
#define BIOTAC_WATCH_H

#include "touch/baseline.h"
#include "touch/sweep.h"

typedef struct {
    bt_baseline base;     // where the signals came to rest
    uint8_t wait_sweeps;  // until what is read now is that; 0 once it was
    uint16_t level_q3;    // the pressure's mean when it last moved
    uint8_t level_sweeps; // for which it has stayed near that; saturates
    int8_t side;        // electrodes whose mean of this sweep is above the watched baseline, less those below
    int16_t one_way_q2; // the same through a low-pass of four sweeps
    bool drifts;        // the last whole sweep says: what moves is drift
} bt_watch;

// A contact begins, or the load changes: what was watched before says nothing.
void bt_watch_begin(bt_watch *watch);

// The signals have come to rest: their means are the baseline. Lanes in `unknown` have none.
void bt_watch_take(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown);

// The means are within span_q3 of the baseline: a glitch or a knock is over, and what has drifted is not
// lost.
bool bt_watch_is_near(const bt_watch *watch, const bt_sweep *sweep, int span_q3);

// After a sweep; pressure_mean_q3 is NULL without a good pressure word in it.
void bt_watch_end(bt_watch *watch, const uint16_t *pressure_mean_q3);

#ifndef BT_CDEF
// An electrode's mean of this sweep, against the baseline that it is to be compared with.
static inline void bt_watch_side(bt_watch *watch, uint32_t mean_q16, uint32_t base_q16)
{
    watch->side = (int8_t)(watch->side + (mean_q16 > base_q16) - (mean_q16 < base_q16));
}
#endif

#endif
