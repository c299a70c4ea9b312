#include "signal/absence.h"

#include "fixed_point.h"
#include "signal/sweep.h"

#include <string.h>

#define ROUND_US (BT_FRAME_MS * 1000u)
#define SWEEP_US (BT_SWEEP_ROUNDS * ROUND_US)

_Static_assert(UINT32_MAX / SWEEP_US <= UINT16_MAX, "sweeps of the longest silence must fit their type");
_Static_assert(BT_SILENCE_ROUNDS *BT_TRIGGER_UNREAD <= UINT16_MAX, "a sum must fit its half of a pair");

static BT_NOINLINE void begin(bt_silence *silence, uint32_t gap_us)
{
    uint32_t sweeps = (gap_us - ROUND_US) / SWEEP_US;
    // A second silence adds to one that was not evaluated yet.
    sweeps += silence->rounds < BT_SILENCE_ROUNDS ? silence->sweeps : 0;
    silence->sweeps = (uint16_t)(sweeps < UINT16_MAX ? sweeps : UINT16_MAX);
    silence->rounds = 0;
    memset(&silence->sum, 0, sizeof silence->sum);
}

bool bt_silence_add(bt_silence *silence, uint32_t t_us, const bt_lanes *smooth)
{
    uint32_t gap_us = t_us - silence->last_us;
    silence->last_us = t_us;
    if (gap_us >= ROUND_US + SWEEP_US) {
        begin(silence, gap_us);
    }
    if (silence->sweeps == 0 || silence->rounds == BT_SILENCE_ROUNDS) {
        return false;
    }
    bt_lanes_add(&silence->sum, smooth);
    return ++silence->rounds == BT_SILENCE_ROUNDS;
}
