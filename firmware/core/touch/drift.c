#include "touch/drift.h"

#include "fixed_point.h"
#include "wire/sensor_gen.h"

#define RATE_Q16      (4 * 328) // per sweep; 15 counts/min; constants.md has fingers that drift faster
#define NEAR_SHIFT    5         // share of the distance in a step
#define SETTLE_SWEEPS 8         // until the moves are drift and not the noise of a new tare
#define FIRST_SWEEPS  16        // a mean is over at least this many
#define KNOWN_SWEEPS  32
#define MEAN_SWEEPS   128    // and at most this many
#define LAST_SWEEPS   1024   // for which an unseen rate goes on
#define NOISE_Q20     150000 // in a tare's sum of moves, two sigmas of a new sensor, one of a worn one
#define COMMIT_SWEEPS 16     // pressure shows a load within so many

_Static_assert(RATE_Q16 * 16LL * LAST_SWEEPS <= INT32_MAX, "what is unseen must fit its type");

void bt_drift_learn(bt_drift *drift)
{
    if (drift->settled < SETTLE_SWEEPS) {
        drift->settled++;
        return;
    }
    bt_drift_rate *now = &drift->now;
    now->sweeps = bt_count_up(now->sweeps, MEAN_SWEEPS);
    int32_t change_q20 = drift->moved_q16 / BT_ELECTRODES * 16 - now->q20;
    now->q20 = bt_clamp(now->q20 + change_q20 / bt_clamp(now->sweeps, FIRST_SWEEPS, MEAN_SWEEPS),
                        -16 * RATE_Q16, 16 * RATE_Q16);
    if (++drift->since_commit >= COMMIT_SWEEPS) {
        drift->since_commit = 0;
        drift->sure = drift->waiting;
        drift->waiting = drift->now;
    }
}

void bt_drift_revert(bt_drift *drift)
{
    drift->now = drift->sure;
    drift->waiting = drift->sure;
    drift->since_commit = 0;
}

void bt_drift_remove_warming(bt_drift *drift, int32_t warming_q16)
{
    int32_t rate_q16 = (int32_t)bt_shift_round(drift->now.q20, 4);
    int32_t least = rate_q16 < 0 ? rate_q16 : 0;
    int32_t most = rate_q16 > 0 ? rate_q16 : 0;
    drift->now.q20 -= 16 * bt_clamp(warming_q16, least, most);
    drift->waiting = drift->now;
    drift->sure = drift->now;
}

bool bt_drift_known(const bt_drift *drift)
{
    return drift->now.sweeps >= KNOWN_SWEEPS;
}

// The drift at a rate in so many sweeps, in 1/2^20 count.
static int32_t made_q20(const bt_drift_rate *rate, uint32_t sweeps)
{
    if (bt_abs32(rate->q20) * rate->sweeps < NOISE_Q20) {
        return 0; // as likely noise as drift
    }
    return rate->q20 * (int32_t)(sweeps < LAST_SWEEPS ? sweeps : LAST_SWEEPS);
}

int32_t bt_drift_over(const bt_drift *drift, uint32_t sweeps)
{
    return (int32_t)bt_shift_round(made_q20(&drift->now, sweeps), 4);
}

int32_t bt_drift_unseen(bt_drift *drift, uint32_t sweeps)
{
    bt_drift_revert(drift);
    int32_t made_q16 = bt_drift_over(drift, sweeps);
    drift->sure.q20 -= made_q20(&drift->sure, sweeps) / LAST_SWEEPS;
    bt_drift_revert(drift);
    return made_q16;
}

int32_t bt_drift_step_q16(const bt_drift *drift, int32_t away_q16)
{
    int32_t step_q16 = (int32_t)bt_shift_round(drift->now.q20, 4) + bt_shift_down(away_q16, NEAR_SHIFT);
    return bt_clamp(step_q16, -RATE_Q16, RATE_Q16);
}
