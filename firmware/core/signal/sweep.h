// Means over eight rounds, a few lanes at a time.
//
// Release, drift and a new tare use means of eight rounds, and none of them is urgent. So each round serves
// only a few lanes and costs little: neighbouring lanes end their eight rounds in different rounds. Eight
// rounds are a sweep; after the last one every lane has been served once.
//
// Units: a sum of eight filtered counts is a mean in 1/8 count (q3), exact.
#ifndef BIOTAC_SWEEP_H
#define BIOTAC_SWEEP_H

#include "signal/trigger.h"

#define BT_SWEEP_ROUNDS 8
#define BT_SWEEP_LANES  3 // served in one round

#define BT_STILL_SPAN_Q3 (12 * 8) // means of still signals stay this close to where they came to rest

#define BT_SWEEP_UNREAD_Q3 (BT_SWEEP_ROUNDS * BT_TRIGGER_UNREAD)

typedef struct {
    bt_lanes sum;
    bt_lanes mean_q3;     // of each lane's latest eight rounds; BT_SWEEP_UNREAD_Q3 for a lane never read
    bt_lanes settled_q3;  // the means at the start of still_sweeps
    uint8_t round;        // of the sweep, 0..BT_SWEEP_ROUNDS - 1
    uint8_t still_sweeps; // whole sweeps since the means came to rest; saturates
    bool begun;           // the first round after a restart has been added
    bool moved;           // a mean left the settled value in this sweep
} bt_sweep;

// Clear everything: the next sweep refills the windows.
void bt_sweep_restart(bt_sweep *sweep);

// Add a round's filtered counts.
void bt_sweep_add(bt_sweep *sweep, const bt_lanes *smooth);

// Fill a lane's window with the first word, which came in the middle of a sweep.
void bt_sweep_fill(bt_sweep *sweep, unsigned lane, uint16_t smooth);

// The lanes that this round serves: first <= lane < end.
#ifndef BT_CDEF
static inline unsigned bt_sweep_first(const bt_sweep *sweep)
{
    return sweep->round * BT_SWEEP_LANES;
}

static inline unsigned bt_sweep_end(const bt_sweep *sweep)
{
    unsigned end = bt_sweep_first(sweep) + BT_SWEEP_LANES;
    return end < BT_LANES ? end : BT_LANES;
}
#endif

// Close one lane's window, check for a move by more than span_q3, and return the mean.
#ifndef BT_CDEF
static inline uint16_t bt_sweep_close(bt_sweep *sweep, unsigned lane, int span_q3)
{
    uint16_t mean_q3 = sweep->sum.lane[lane];
    sweep->sum.lane[lane] = 0;
    sweep->mean_q3.lane[lane] = mean_q3;
    int change_q3 = mean_q3 - sweep->settled_q3.lane[lane];
    if (change_q3 > span_q3 || change_q3 < -span_q3) {
        sweep->moved = true;
    }
    return mean_q3;
}
#endif

// After a sweep's last round: update still_sweeps and start over.
void bt_sweep_start_over(bt_sweep *sweep);

// End a round. Returns true after the last one of a sweep.
#ifndef BT_CDEF
static inline bool bt_sweep_next(bt_sweep *sweep)
{
    if (++sweep->round < BT_SWEEP_ROUNDS) {
        return false;
    }
    bt_sweep_start_over(sweep);
    return true;
}
#endif

#endif
