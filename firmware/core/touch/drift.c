#include "touch/drift.h"

#include "fixed_point.h"
#include "wire/sensor_gen.h"

#define RATE_Q16           (4 * 328) // per sweep; 15 counts/min, the worst drift measured
#define NEAR_SHIFT         5         // share of the distance in a step
#define SETTLE_SWEEPS      16        // until what is followed is drift and not the noise of taking the tare
#define FIRST_SWEEPS       16        // a mean is over at least this many
#define KNOWN_SWEEPS       32
#define MEAN_SWEEPS        128 // and at most this many
#define EXTRAPOLATED_TIMES 8   // a rate is taken to last for this many times as long as it was seen
#define COMMIT_SWEEPS      32  // pressure shows a load within this many

_Static_assert(RATE_Q16 * 16LL * EXTRAPOLATED_TIMES * MEAN_SWEEPS <= INT32_MAX,
               "what is unseen must fit its type");

static int32_t mean_sweeps(const bt_drift *drift)
{
    return drift->sweeps > FIRST_SWEEPS ? drift->sweeps : FIRST_SWEEPS;
}

void bt_drift_learn(bt_drift *drift)
{
    if (drift->settled < SETTLE_SWEEPS) {
        drift->settled++;
        return;
    }
    if (drift->sweeps < MEAN_SWEEPS) {
        drift->sweeps++;
    }
    int32_t change_q20 = drift->moved_q16 / BT_ELECTRODES * 16 - drift->rate_q20;
    int32_t rate_q20 = drift->rate_q20 + change_q20 / mean_sweeps(drift);
    drift->rate_q20 = bt_clamp(rate_q20, -16 * RATE_Q16, 16 * RATE_Q16);
    if (++drift->since_commit >= COMMIT_SWEEPS) {
        drift->since_commit = 0;
        drift->sure_q20 = drift->waiting_q20;
        drift->waiting_q20 = drift->rate_q20;
    }
}

void bt_drift_revert(bt_drift *drift)
{
    drift->rate_q20 = drift->sure_q20;
    drift->waiting_q20 = drift->sure_q20;
    drift->since_commit = 0;
}

void bt_drift_remove_warming(bt_drift *drift, int32_t warming_q16)
{
    int32_t rate_q16 = (int32_t)bt_shift_round(drift->rate_q20, 4);
    int32_t least = rate_q16 < 0 ? rate_q16 : 0;
    int32_t most = rate_q16 > 0 ? rate_q16 : 0;
    drift->rate_q20 -= 16 * bt_clamp(warming_q16, least, most);
    drift->waiting_q20 = drift->rate_q20;
    drift->sure_q20 = drift->rate_q20;
}

bool bt_drift_known(const bt_drift *drift)
{
    return drift->sweeps >= KNOWN_SWEEPS;
}

// The drift at a rate in so many sweeps, in 1/2^20 count.
static int32_t made_q20(const bt_drift *drift, int32_t rate_q20, uint32_t sweeps)
{
    uint32_t last = (uint32_t)(EXTRAPOLATED_TIMES * mean_sweeps(drift));
    return rate_q20 * (int32_t)(sweeps < last ? sweeps : last);
}

int32_t bt_drift_over(const bt_drift *drift, uint32_t sweeps)
{
    return (int32_t)bt_shift_round(made_q20(drift, drift->rate_q20, sweeps), 4);
}

int32_t bt_drift_unseen(bt_drift *drift, uint32_t sweeps)
{
    int32_t made_q16 = bt_drift_over(drift, sweeps);
    int32_t last = EXTRAPOLATED_TIMES * mean_sweeps(drift);
    drift->rate_q20 -= made_q20(drift, drift->rate_q20, sweeps) / last;
    drift->waiting_q20 -= made_q20(drift, drift->waiting_q20, sweeps) / last;
    drift->sure_q20 -= made_q20(drift, drift->sure_q20, sweeps) / last;
    return made_q16;
}

int32_t bt_drift_step_q16(const bt_drift *drift, int32_t away_q16)
{
    int32_t step_q16 = (int32_t)bt_shift_round(drift->rate_q20, 4) + bt_shift_down(away_q16, NEAR_SHIFT);
    return bt_clamp(step_q16, -RATE_Q16, RATE_Q16);
}
