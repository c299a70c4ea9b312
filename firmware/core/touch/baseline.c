#include "touch/baseline.h"

#define SNAPSHOT_SWEEPS 3 // 240 ms
#define ROLL_BACK       5 // snapshots

_Static_assert(ROLL_BACK < BT_SNAPSHOTS, "the roll-back must be in the ring");
_Static_assert(ROLL_BACK * SNAPSHOT_SWEEPS * BT_SWEEP_ROUNDS * BT_FRAME_MS >= 1000,
               "the roll-back must reach back a second");

void bt_baseline_present(bt_baseline *base, const bt_sweep *sweep, uint32_t unknown)
{
    for (unsigned i = 0; i < BT_LANES; i++) {
        base->lane_q16[i] = unknown >> i & 1 ? BT_TARE_UNKNOWN : (uint32_t)sweep->mean_q3.lane[i] << 13;
    }
}

void bt_rollback_start(bt_rollback *rollback, const bt_baseline *base)
{
    rollback->snapshot[0] = *base;
    rollback->head = 0;
    rollback->count = 1;
    rollback->countdown = SNAPSHOT_SWEEPS;
}

void bt_rollback_keep(bt_rollback *rollback, const bt_baseline *base)
{
    if (--rollback->countdown > 0) {
        return;
    }
    rollback->countdown = SNAPSHOT_SWEEPS;
    rollback->head = (uint8_t)((rollback->head + 1) % BT_SNAPSHOTS);
    rollback->snapshot[rollback->head] = *base;
    rollback->count = bt_count_up(rollback->count, BT_SNAPSHOTS);
}

void bt_rollback_fill(bt_rollback *rollback, unsigned lane, uint32_t first_q16)
{
    for (int k = 0; k < BT_SNAPSHOTS; k++) {
        rollback->snapshot[k].lane_q16[lane] = first_q16;
    }
}

static int back_by(const bt_rollback *rollback)
{
    return rollback->count > ROLL_BACK ? ROLL_BACK : rollback->count - 1;
}

uint32_t bt_rollback_sweeps(const bt_rollback *rollback)
{
    return (uint32_t)(SNAPSHOT_SWEEPS * (back_by(rollback) + 1) - rollback->countdown);
}

const bt_baseline *bt_rollback_before(const bt_rollback *rollback)
{
    int back = back_by(rollback);
    return &rollback->snapshot[(rollback->head + BT_SNAPSHOTS - back) % BT_SNAPSHOTS];
}
