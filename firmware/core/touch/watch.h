// A second baseline, from where a finger's signals came to rest. It detects the next contact while the tare
// must stay; and moves away from it while nothing touches are drift.
//
// A load moves the static pressure, and presses some electrodes while others bulge. Drift moves nearly all
// electrodes one way while the pressure stays level. So a tare may follow drift by this rule, even under a
// load; without pressure it follows nothing, and only moves that all share (drift.h).
//
// Units: counts in 1/65536 (q16) and 1/8 (q3); time in sweeps of 80 ms.
#ifndef BIOTAC_WATCH_H
#define BIOTAC_WATCH_H

#include "signal/absence.h"
#include "signal/sweep.h"
#include "touch/baseline.h"

#define BT_WATCH_SWEEPS 5   // of still signals, after which they count as at rest
#define BT_CREEP_SWEEPS 250 // since the load changed: 20 s, two time constants of creep

typedef struct {
    bt_baseline base;     // where the signals came to rest
    uint8_t wait_sweeps;  // until base is set to the present reading; 0 once it was
    bool early;           // base is still the reading soon after pressure had moved, moving or not
    uint16_t level_q3;    // mean pressure when it last moved
    uint8_t level_sweeps; // sweeps near that pressure; saturates
    bool slow;            // moved only after a long plateau
    uint8_t creeps;       // sweeps since the load changed; saturates
    int8_t side;          // electrodes with a mean of this sweep above the second baseline, less those below
    int16_t side_avg_q2;  // the same through a low-pass of four sweeps
    int32_t away_q3;      // distances of this sweep's means from the second baseline, added up
    uint32_t farthest_q3; // the largest of these in a touch
    int32_t shared_q16;   // their mean in the last whole sweep
    bool aligned;         // in the last whole sweep nearly all had moved one way
    bool alike;           // in the last whole sweep all but one had, and none by much more than the mean
    bool follows;         // each electrode has its pace of drift
} bt_watch;

// A contact begins, or the load changes: the baseline is void.
void bt_watch_begin(bt_watch *watch);

// A touch that may prove to be none: the baseline stays, in case the signals come back to it.
void bt_watch_pause(bt_watch *watch);

// The signals have come to rest: their means are the baseline. Lanes in `unknown` have none.
void bt_watch_store(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown);

// After a sweep in contact. Soon after pressure has moved, the means are an early baseline, at rest or not: a
// common move from there, while pressure stays, is drift.
void bt_watch_wait(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown);

// The same for signals that may have come back. Within span_q3 of the baseline nothing changes, so that drift
// is not lost. Within twice that, skin has crept: the common part is left out of the new baseline, still to
// be followed.
void bt_watch_return(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown, int span_q3);

// After a sweep; pressure_mean_q3 is NULL if it had no good pressure word.
void bt_watch_end(bt_watch *watch, const uint16_t *pressure_mean_q3);

// True soon after a change of load, while skin creeps by more than it drifts.
bool bt_watch_creeps(const bt_watch *watch);

// True if pressure has been level for long enough to distinguish drift from a load.
bool bt_watch_level(const bt_watch *watch);

// A finger is back from a silence, with a good pressure word. The silence counts as level if pressure moved
// by no more than creep would. Returns the step of drift that all electrodes missed, in q16 counts; 0 if one
// alone has moved by more than span_q3.
int32_t bt_watch_resume(bt_watch *watch, const bt_silence *silence, int span_q3);

// The clear common move of all electrodes, as a step of drift; else 0.
int32_t bt_watch_drifts_q16(const bt_watch *watch);

#ifndef BT_CDEF
// True if the signals of a touch have come to rest, so that their means show later moves.
static inline bool bt_watch_sees(const bt_watch *watch, const bt_sweep *sweep)
{
    return watch->wait_sweeps == 0 && sweep->still_sweeps >= BT_WATCH_SWEEPS;
}

// Add an electrode's mean of this sweep, compared with the baseline. Returns the distance in 1/8 count.
static inline int32_t bt_watch_side(bt_watch *watch, uint32_t mean_q16, uint32_t base_q16)
{
    if (base_q16 == BT_TARE_UNKNOWN) {
        return 0;
    }
    watch->side = (int8_t)(watch->side + (mean_q16 > base_q16) - (mean_q16 < base_q16));
    int32_t away_q3 = (int32_t)(mean_q16 >> 13) - (int32_t)(base_q16 >> 13);
    watch->away_q3 += away_q3;
    return away_q3;
}

// An electrode's step of drift. With separate paces: a quarter more than step_q16 where it lags, else a
// quarter less.
static inline int32_t bt_watch_step_q16(const bt_watch *watch, int32_t step_q16, uint32_t mean_q16,
                                        uint32_t base_q16)
{
    if (!watch->follows) {
        return step_q16;
    }
    bool lags = step_q16 > 0 ? mean_q16 > base_q16 : mean_q16 < base_q16;
    return step_q16 + (lags ? step_q16 / 4 : -(step_q16 / 4));
}
#endif

#endif
