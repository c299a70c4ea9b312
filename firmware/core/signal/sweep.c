#include "signal/sweep.h"

#include "fixed_point.h"

#include <string.h>

_Static_assert(BT_SWEEP_ROUNDS *BT_TRIGGER_UNREAD <= UINT16_MAX,
               "a sum must fit its half of a pair, or it would carry into its neighbour");
_Static_assert((BT_SWEEP_ROUNDS - 1) * BT_SWEEP_LANES >= BT_LANES,
               "the last round of a sweep must serve no lane: it judges the sweep");

void bt_sweep_restart(bt_sweep *sweep)
{
    memset(sweep, 0, sizeof *sweep);
}

void bt_sweep_fill(bt_sweep *sweep, unsigned lane, uint16_t smooth)
{
    // Sum the rounds since the lane's last turn, as if the word had been there all along. The lane's turn
    // comes in round lane / BT_SWEEP_LANES, which adds the word once more.
    unsigned turn = lane / BT_SWEEP_LANES;
    unsigned left = (turn + BT_SWEEP_ROUNDS - sweep->round) % BT_SWEEP_ROUNDS;
    sweep->sum.lane[lane] = (uint16_t)((BT_SWEEP_ROUNDS - 1 - left) * smooth);
    sweep->mean_q3.lane[lane] = (uint16_t)(BT_SWEEP_ROUNDS * smooth);
    sweep->settled_q3.lane[lane] = sweep->mean_q3.lane[lane];
}

static BT_NOINLINE void begin(bt_sweep *sweep, const bt_lanes *smooth)
{
    sweep->begun = true;
    for (unsigned i = 0; i < BT_LANES; i++) {
        bt_sweep_fill(sweep, i, smooth->lane[i]);
    }
}

void bt_sweep_add(bt_sweep *sweep, const bt_lanes *smooth)
{
    if (!sweep->begun) {
        begin(sweep, smooth);
    }
    bt_lanes_add(&sweep->sum, smooth);
}

void bt_sweep_start_over(bt_sweep *sweep)
{
    sweep->round = 0;
    if (sweep->moved) {
        sweep->settled_q3 = sweep->mean_q3;
        sweep->still_sweeps = 0;
    } else {
        sweep->still_sweeps = bt_count_up(sweep->still_sweeps, UINT8_MAX);
    }
    sweep->moved = false;
}
