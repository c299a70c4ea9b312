// A baseline: the counts of every electrode and of static pressure at rest. Baselines of the last two seconds
// are stored, for a touch to go back to.
//
// Units: counts in 1/65536 (q16); rounds half away from zero when published in 1/16 count.
#ifndef BIOTAC_BASELINE_H
#define BIOTAC_BASELINE_H

#include "signal/sweep.h"

#define BT_TARE_UNKNOWN 0xFFFFFFFFu // a channel that was never read
#define BT_SNAPSHOTS    8

// Per sweep; 0.5 count/s: faster drift is not followed, so that no load is.
#define BT_SLEW_Q16 (8 * 328)

typedef union {
    struct {
        uint32_t electrode_q16[BT_ELECTRODES];
        uint32_t pdc_q16;
    };
    uint32_t lane_q16[BT_LANES];
} bt_baseline;

// The means of the latest sweep. Lanes in `unknown` have none.
void bt_baseline_present(bt_baseline *base, const bt_sweep *sweep, uint32_t unknown);

typedef struct {
    bt_baseline snapshot[BT_SNAPSHOTS];
    uint8_t head; // the latest
    uint8_t count;
    uint8_t countdown; // sweeps until the next
} bt_rollback;

// A new baseline: none from before may come back.
void bt_rollback_start(bt_rollback *rollback, const bt_baseline *base);

// Call after each sweep at rest.
void bt_rollback_keep(bt_rollback *rollback, const bt_baseline *base);

// Put a lane's first value into all snapshots.
void bt_rollback_fill(bt_rollback *rollback, unsigned lane, uint32_t first_q16);

// The baseline of at least a second ago, or the oldest there is.
const bt_baseline *bt_rollback_before(const bt_rollback *rollback);

// Age of that baseline in sweeps.
uint32_t bt_rollback_sweeps(const bt_rollback *rollback);

#ifndef BT_CDEF
#include "fixed_point.h"

// The value, moved by step_q16. It stays within 0..full scale, and an unknown one stays unknown.
static inline uint32_t bt_baseline_moved(uint32_t base_q16, int32_t step_q16)
{
    if (base_q16 == BT_TARE_UNKNOWN) {
        return base_q16;
    }
    return (uint32_t)bt_clamp((int32_t)base_q16 + step_q16, 0, BT_FULL_SCALE_COUNT << 16);
}

// A known value in whole counts.
static inline int32_t bt_baseline_count(uint32_t base_q16)
{
    return (int32_t)((base_q16 + (1 << 15)) >> 16);
}

// The value as subtracted and published: 1/16 count; BT_INVALID_COUNT when unknown.
static inline uint16_t bt_tare_q4(uint32_t base_q16)
{
    return base_q16 == BT_TARE_UNKNOWN ? BT_INVALID_COUNT : (uint16_t)((base_q16 + (1 << 11)) >> 12);
}
#endif

#endif
