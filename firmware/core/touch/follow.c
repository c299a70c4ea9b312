#include "touch/follow.h"

#include "touch/adopt.h"

#include "fixed_point.h"

#define PDC_SLEW_Q16 (8 * 131)  // per sweep; 0.2 count/s
#define PDC_SINK_Q16 (8 * 655)  // 1 count/s: no load lowers pressure
#define PDC_BACK_Q16 (8 * 2621) // 4 counts/s: pressure comes back within seconds after a press
#define BACK_ROUNDS  400        // after a new tare
// Weight the common offset above the individual one: drift is shared, noise is not. Electrodes followed one
// by one lag a worn finger's worst drift by a count.
#define SHARED_TIMES 4

// The square of a difference in count^2, rounded down. Differences are below 2^16 in 1/16 count, so the
// unsigned square fits, and so does the sum over all electrodes.
static uint32_t square(int32_t difference_q4)
{
    return (uint32_t)difference_q4 * (uint32_t)difference_q4 >> 8;
}

// Move the tare and the second baseline alike.
static BT_NOINLINE void shift_electrode(bt_tare *tare, unsigned i, int32_t step_q16)
{
    tare->base.electrode_q16[i] = bt_baseline_moved(tare->base.electrode_q16[i], step_q16);
    tare->watch.base.electrode_q16[i] = bt_baseline_moved(tare->watch.base.electrode_q16[i], step_q16);
    bt_adopt_electrode(tare, i);
}

// Only in a sweep that began at rest: a new tare stays as given for at least a round, and a touch is never
// tracked.
static bool rests(const bt_tare *tare)
{
    return tare->state == BT_TARE_STATE_REST && tare->hits == 0 && !tare->partial;
}

static void shift_all(bt_tare *tare, int32_t step_q16)
{
    for (unsigned i = 0; i < BT_ELECTRODES && step_q16 != 0; i++) {
        shift_electrode(tare, i, step_q16);
        tare->partial = true;
    }
}

BT_NOINLINE void bt_follow_resume(bt_tare *tare)
{
    bool known = bt_drift_known(&tare->drift);
    shift_all(tare, bt_drift_unseen(&tare->drift, tare->silence.sweeps));
    if (bt_tare_touched(tare) && tare->trigger.pressure_now && tare->witness.moves) {
        int32_t step_q16 = bt_watch_resume(&tare->watch, &tare->silence, BT_STILL_SPAN_Q3);
        shift_all(tare, known ? 0 : step_q16);
    }
}

static void serve_touched(bt_tare *tare, unsigned first, unsigned end)
{
    bt_watch *watch = &tare->watch;
    const bool based = watch->wait_sweeps == 0 || watch->early, watched = bt_watch_sees(watch, &tare->sweep);
    for (unsigned i = first; i < end; i++) {
        uint32_t mean_q3 = bt_sweep_close(&tare->sweep, i, BT_STILL_SPAN_Q3);
        if (mean_q3 == BT_SWEEP_UNREAD_Q3) {
            continue;
        }
        int32_t away_q4 = (int32_t)(2 * mean_q3) - tare->electrode_q4[i];
        int32_t drift_q16 = tare->drift_q16;
        tare->energy_count2 += square(away_q4);
        tare->sum_q4 += away_q4;
        if (based) {
            uint32_t size_q3 = bt_abs32(bt_watch_side(watch, mean_q3 << 13, watch->base.electrode_q16[i]));
            watch->farthest_q3 = size_q3 > watch->farthest_q3 ? size_q3 : watch->farthest_q3;
        }
        if (watched) {
            drift_q16 = bt_watch_step_q16(watch, drift_q16, mean_q3 << 13, watch->base.electrode_q16[i]);
        }
        tare->drift.moved_q16 += drift_q16;
        drift_q16 += tare->thermal.step_q16;
        if (drift_q16 != 0) {
            shift_electrode(tare, i, drift_q16);
            uint32_t watched_q16 = watch->base.electrode_q16[i];
            if (watched && watched_q16 != BT_TARE_UNKNOWN) { // or drift would look like motion
                tare->sweep.settled_q3.lane[i] = (uint16_t)(watched_q16 >> 13);
            }
        }
    }
}

static void serve_untouched(bt_tare *tare, unsigned first, unsigned end)
{
    bt_watch *watch = &tare->watch;
    const bool resting = rests(tare), held = tare->held;
    const int32_t drift_q16 = tare->drift_q16, shared_q16 = SHARED_TIMES * watch->shared_q16;
    for (unsigned i = first; i < end; i++) {
        uint32_t mean_q3 = bt_sweep_close(&tare->sweep, i, BT_STILL_SPAN_Q3);
        if (mean_q3 == BT_SWEEP_UNREAD_Q3) {
            continue;
        }
        // The sum counts only if every round was below the threshold, so it stays far below 2^32.
        int32_t away_q3 = 8 * tare->trigger.smooth.lane[i] - (int32_t)mean_q3;
        tare->deviation_q6 += (uint32_t)(away_q3 * away_q3);
        uint32_t mean_q16 = mean_q3 << 13, before_q16 = tare->base.electrode_q16[i];
        (void)bt_watch_side(watch, mean_q16, before_q16);
        if (!resting) {
            continue;
        }
        int32_t away_q16 = bt_clamp((int32_t)(mean_q16 - before_q16) + shared_q16, -BT_SLEW_Q16, BT_SLEW_Q16);
        int32_t step_q16 = // a held finger follows drift only
            held ? bt_watch_step_q16(watch, drift_q16, mean_q16, before_q16) : drift_q16 + away_q16;
        uint32_t base_q16 = bt_baseline_moved(before_q16, step_q16);
        tare->base.electrode_q16[i] = base_q16;
        tare->drift.moved_q16 += (int32_t)(base_q16 - before_q16);
        bt_adopt_electrode(tare, i);
    }
}

static void serve_pressure(bt_tare *tare)
{
    uint32_t mean_q16 = (uint32_t)bt_sweep_close(&tare->sweep, BT_LANE_PDC, BT_STILL_SPAN_Q3) << 13;
    if (rests(tare) && !tare->held && bt_tare_pdc_known(tare)) {
        uint32_t before_q16 = tare->base.pdc_q16;
        int32_t rise_q16 = tare->age_rounds < BACK_ROUNDS ? PDC_BACK_Q16 : PDC_SLEW_Q16;
        int32_t slew_q16 = mean_q16 < before_q16 ? PDC_SINK_Q16 : rise_q16;
        int32_t step_q16 = bt_clamp((int32_t)(mean_q16 - before_q16), -slew_q16, slew_q16);
        tare->base.pdc_q16 = bt_baseline_moved(before_q16, step_q16);
        bt_adopt_aim_pressure(tare);
    }
}

void bt_follow_turn(bt_tare *tare)
{
    const unsigned first = bt_sweep_first(&tare->sweep), end = bt_sweep_end(&tare->sweep);
    const unsigned electrodes = end < BT_LANES ? end : BT_ELECTRODES;
    if (first < electrodes && bt_tare_touched(tare)) {
        serve_touched(tare, first, electrodes);
    } else if (first < electrodes) {
        serve_untouched(tare, first, electrodes);
    }
    if (first <= BT_LANE_PDC && end == BT_LANES) {
        serve_pressure(tare);
    }
}
