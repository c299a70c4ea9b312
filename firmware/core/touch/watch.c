#include "touch/watch.h"

#include "fixed_point.h"

#include <stddef.h>

#define LEVEL_Q3     16 // two counts, four sigmas; a load of 0.02 N/s exceeds it within a second
#define LEVEL_SWEEPS 32 // 2.6 s
#define WAIT_SWEEPS  5  // until means are free of earlier readings
#define EARLY_SWEEPS 3  // of these to go when most means are
#define SIDE_MIN_Q2  26 // 13 electrodes one way and 6 the other: three sigmas of noise
#define ALIKE_SIDE   17 // 18 electrodes one way and one the other
#define ALIKE_TIMES  3  // the mean; a real press that moves all one way moves one electrode by four
#define CREEP_Q3     (5 * LEVEL_Q3)    // most in a silence: 13 s of skin creep at the limit of level
#define MISSED_Q16   (BT_SLEW_Q16 / 2) // 15 counts/min, the worst drift measured, as so few rounds are noisy
#define EACH_Q16     (8192 / BT_ELECTRODES) // the mean in q16, from a sum over all electrodes in 1/8 count

_Static_assert((int64_t)BT_ELECTRODES * BT_SWEEP_UNREAD_Q3 * EACH_Q16 <= INT32_MAX,
               "a sum of distances must fit its type");
_Static_assert((int64_t)UINT16_MAX *BT_SLEW_Q16 <= INT32_MAX,
               "what is due of the longest silence must fit its type");

bool bt_watch_creeps(const bt_watch *watch)
{
    return watch->creeps < BT_CREEP_SWEEPS;
}

bool bt_watch_level(const bt_watch *watch)
{
    return watch->slow || watch->level_sweeps >= LEVEL_SWEEPS;
}

void bt_watch_pause(bt_watch *watch)
{
    watch->wait_sweeps = WAIT_SWEEPS;
    watch->early = false;
    watch->aligned = false;
    watch->follows = false;
    watch->side_avg_q2 = 0;
    watch->shared_q16 = 0;
}

void bt_watch_begin(bt_watch *watch)
{
    bt_watch_pause(watch);
    watch->base.electrode_q16[0] = BT_TARE_UNKNOWN; // far from any reading
    watch->creeps = 0;
}

int32_t bt_watch_drifts_q16(const bt_watch *watch)
{
    return watch->aligned ? bt_clamp(watch->shared_q16, -BT_SLEW_Q16, BT_SLEW_Q16) : 0;
}

void bt_watch_store(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown)
{
    watch->wait_sweeps = 0;
    watch->early = false;
    bt_baseline_present(&watch->base, sweep, unknown);
}

void bt_watch_wait(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown)
{
    uint8_t left = (uint8_t)(watch->wait_sweeps - (watch->wait_sweeps > 1));
    if (left == EARLY_SWEEPS && watch->base.electrode_q16[0] == BT_TARE_UNKNOWN) {
        bt_watch_store(watch, sweep, unknown);
        watch->early = true;
    }
    watch->wait_sweeps = left;
}

void bt_watch_return(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown, int span_q3)
{
    int32_t sum_q3 = 0;
    int32_t farthest_q3 = 0;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t away_q3 = sweep->mean_q3.lane[i] - (int32_t)(watch->base.electrode_q16[i] >> 13);
        int32_t far_q3 = (int32_t)bt_abs32(away_q3);
        farthest_q3 = far_q3 > farthest_q3 ? far_q3 : farthest_q3;
        sum_q3 += away_q3;
    }
    watch->wait_sweeps = 0;
    if (farthest_q3 <= span_q3 && !watch->early) {
        return;
    }
    bool crept = farthest_q3 <= 2 * span_q3 && !watch->early;
    bt_watch_store(watch, sweep, unknown);
    for (unsigned i = 0; i < BT_ELECTRODES && crept; i++) {
        watch->base.electrode_q16[i] = bt_baseline_moved(watch->base.electrode_q16[i], -sum_q3 * EACH_Q16);
    }
}

void bt_watch_end(bt_watch *watch, const uint16_t *pressure_mean_q3)
{
    watch->creeps = bt_count_up(watch->creeps, UINT8_MAX);
    int change_q3 = pressure_mean_q3 == NULL ? LEVEL_Q3 + 1 : *pressure_mean_q3 - watch->level_q3;
    if (change_q3 > LEVEL_Q3 || change_q3 < -LEVEL_Q3) {
        // Skin creeps: pressure that moved by so little after so long still counts as level.
        watch->slow = pressure_mean_q3 != NULL && watch->level_sweeps >= LEVEL_SWEEPS;
        watch->level_q3 = pressure_mean_q3 == NULL ? 0 : *pressure_mean_q3;
        watch->level_sweeps = 0;
        if (!watch->slow) {
            bt_watch_begin(watch);
        }
    } else {
        watch->level_sweeps = bt_count_up(watch->level_sweeps, UINT8_MAX);
    }
    watch->side_avg_q2 = (int16_t)(watch->side_avg_q2 + watch->side - bt_shift_down(watch->side_avg_q2, 2));
    watch->aligned = watch->side_avg_q2 >= SIDE_MIN_Q2 || watch->side_avg_q2 <= -SIDE_MIN_Q2;
    watch->shared_q16 = watch->away_q3 * EACH_Q16;
    watch->alike = bt_abs32(watch->side) >= ALIKE_SIDE
                   && watch->farthest_q3 * BT_ELECTRODES <= ALIKE_TIMES * bt_abs32(watch->away_q3);
    watch->side = 0;
    watch->away_q3 = 0;
    watch->farthest_q3 = 0;
}

// True if pressure was level throughout the silence. *due: sweeps in which drift would have been followed.
static bool resume_level(bt_watch *watch, const bt_silence *silence, int32_t *due)
{
    int32_t pressure_q3 = silence->sum.lane[BT_LANE_PDC] * 8 / BT_SILENCE_ROUNDS;
    int32_t sweeps = watch->level_sweeps + silence->sweeps;
    int32_t change_q3 = pressure_q3 - watch->level_q3;
    int32_t creep_q3 = bt_clamp(sweeps * LEVEL_Q3 / LEVEL_SWEEPS, LEVEL_Q3, CREEP_Q3);
    if (change_q3 > creep_q3 || change_q3 < -creep_q3) {
        return false;
    }
    *due = bt_watch_level(watch) ? silence->sweeps : bt_clamp(sweeps - LEVEL_SWEEPS, 0, silence->sweeps);
    if (change_q3 > LEVEL_Q3 || change_q3 < -LEVEL_Q3) {
        watch->slow = true;
        watch->level_q3 = (uint16_t)pressure_q3;
        sweeps = 0;
    }
    watch->level_sweeps = (uint8_t)bt_clamp(sweeps, 0, UINT8_MAX);
    return true;
}

int32_t bt_watch_resume(bt_watch *watch, const bt_silence *silence, int span_q3)
{
    int32_t due = 0;
    if (!resume_level(watch, silence, &due) || watch->wait_sweeps != 0) {
        return 0;
    }
    int32_t away_q3[BT_ELECTRODES];
    int32_t sum_q3 = 0;
    int32_t side = 0;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        bool known = watch->base.electrode_q16[i] != BT_TARE_UNKNOWN;
        int32_t now_q3 = silence->sum.lane[i] * 8 / BT_SILENCE_ROUNDS;
        away_q3[i] = known ? now_q3 - (int32_t)(watch->base.electrode_q16[i] >> 13) : 0;
        sum_q3 += away_q3[i];
        side += (away_q3[i] > 0) - (away_q3[i] < 0);
    }
    bool even = 4 * side >= SIDE_MIN_Q2 || 4 * side <= -SIDE_MIN_Q2;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t apart_q3 = away_q3[i] - sum_q3 / BT_ELECTRODES;
        bool known = watch->base.electrode_q16[i] != BT_TARE_UNKNOWN;
        even = even && (!known || (apart_q3 <= span_q3 && apart_q3 >= -span_q3));
    }
    // The first two hold this sweep's lanes so far, against a baseline that now moves; the third would move
    // the other lanes twice.
    watch->side = 0;
    watch->away_q3 = 0;
    watch->shared_q16 = 0;
    return even ? bt_clamp(sum_q3 * EACH_Q16, -due * MISSED_Q16, due * MISSED_Q16) : 0;
}
