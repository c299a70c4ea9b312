#include "touch/judge.h"

#include "touch/adopt.h"

#include "fixed_point.h"

#include <stddef.h>

#define FAINT_Q16      (1 << 16) // what all electrodes share and may be drift
#define PATTERN_SHARE  4         // of a press's energy is not shared by all electrodes, at least
#define DRIFTED_Q16    (2 << 16)
#define ALIKE_Q16      (3 << 16)   // and for each quarter of a count that temperature moved them by, two more
#define DRIFTED_SWEEPS 64          // of rest, until drift counts as over
#define DRIFT_ROUNDS_PER_COUNT 400 // 15 counts/min, the worst drift measured
#define DRIFT_LIMIT            60000

_Static_assert((uint64_t)DRIFT_LIMIT *DRIFT_LIMIT <= UINT32_MAX, "the forgiven drift must fit 32 bits");
_Static_assert(BT_ELECTRODES == 19, "220753 / 2^22 is 1/19");
_Static_assert(BT_ELECTRODES *(int64_t)BT_FULL_SCALE_COUNT *BT_FULL_SCALE_COUNT <= INT32_MAX,
               "squares of counts over all electrodes must fit 32 bits");

// The squared distances of counts from a tare over all electrodes that have both, and the sum of these.
static uint32_t distance_count2(const bt_lanes *counts, unsigned shift, const bt_baseline *base, int32_t *sum)
{
    uint32_t energy = 0;
    *sum = 0;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t count = counts->lane[i] >> shift;
        if (base->electrode_q16[i] != BT_TARE_UNKNOWN && count <= BT_FULL_SCALE_COUNT) {
            int32_t e = count - bt_baseline_count(base->electrode_q16[i]);
            energy += (uint32_t)(e * e);
            *sum += e;
        }
    }
    return energy;
}

bool bt_inverted(const bt_lanes *smooth, const bt_baseline *base, int32_t pdc_missing)
{
    int32_t below = (int32_t)(base->pdc_q16 >> 16) - smooth->lane[BT_LANE_PDC], sum;
    return base->pdc_q16 != BT_TARE_UNKNOWN && below > pdc_missing
           && distance_count2(smooth, 0, base, &sum) > BT_INVERTED_COUNT2;
}

BT_NOINLINE void bt_judge_inverted(bt_tare *tare)
{
    // By all the cooling, also from before it was let go: at rest too, pressure is low by that.
    int32_t missing = bt_pdc_missing_max(tare->release.pdc_peak) + bt_thermal_cooled_pdc(&tare->thermal);
    bool inverted = bt_inverted(&tare->trigger.smooth, &tare->base, missing);
    tare->inverted_rounds = inverted ? (uint8_t)(tare->inverted_rounds + 1) : 0;
    if (tare->inverted_rounds == BT_INVERTED_ROUNDS) {
        bt_discard_tare(tare);
    }
}

// Energy that may be due to untracked drift and temperature. Drift is 15 counts a minute, the worst measured,
// as long as there is pressure to tell it from a load. Of what was followed for temperature, half may be
// wrong.
static uint32_t forgiven_count2(const bt_tare *tare)
{
    uint32_t rounds = tare->contact_rounds < DRIFT_LIMIT ? tare->contact_rounds : DRIFT_LIMIT;
    uint32_t drift_count2 = rounds * rounds / (DRIFT_ROUNDS_PER_COUNT * DRIFT_ROUNDS_PER_COUNT);
    uint32_t warm_count = bt_abs32(tare->thermal.applied_q16) >> 16;
    return BT_ELECTRODES
           * ((tare->pressure_seen && tare->witness.moves ? drift_count2 : 0)
              + warm_count * warm_count / (BT_WRONG_SHARE * BT_WRONG_SHARE));
}

// The energy without what all electrodes have moved by. The division by 19 is a product and a shift, off by
// less than a millionth.
static uint32_t uneven_count2(const bt_tare *tare)
{
    uint64_t sum_q4 = bt_abs32(tare->sum_q4);
    uint32_t even_count2 = (uint32_t)((sum_q4 * sum_q4 >> 8) * 220753 >> 22);
    return tare->energy_count2 > even_count2 ? tare->energy_count2 - even_count2 : 0;
}

static int32_t pressed(const bt_tare *tare, int32_t above)
{
    return bt_release_pressed(&tare->release, above, bt_thermal_warmed_pdc(&tare->thermal));
}

BT_NOINLINE void bt_judge_felt(bt_tare *tare)
{
    int32_t press = pressed(tare, tare->release.lesser), sum;
    uint32_t energy = press == 0 ? 0 : distance_count2(&tare->trigger.smooth, 0, &tare->base, &sum);
    bt_release_felt(&tare->release, press, energy, tare->threshold_count2);
}

// After a sweep in contact: has it ended? A tare is made of means, and right after a release these are still
// the press's, so both the pressure and its mean must have fallen.
static void act_on_release(bt_tare *tare)
{
    int32_t mean = tare->sweep.mean_q3.lane[BT_LANE_PDC] >> 3;
    int32_t now = tare->trigger.smooth.lane[BT_LANE_PDC];
    bt_release_sweep sweep = {
        .energy_count2 = tare->energy_count2,
        .uneven_count2 = uneven_count2(tare),
        .forgiven_count2 = forgiven_count2(tare),
        .pressure = tare->pressure_seen && tare->base.pdc_q16 != BT_TARE_UNKNOWN,
        .pressed = pressed(tare, (mean < now ? mean : now) - bt_baseline_count(tare->base.pdc_q16)),
        .above = (mean > now ? mean : now) - bt_baseline_count(tare->base.pdc_q16),
        .cold = bt_thermal_cooled_pdc(&tare->thermal),
        .still_sweeps = tare->sweep.still_sweeps,
        .level_sweeps = tare->watch.level_sweeps,
        .warmer = bt_thermal_warmed_q8(&tare->thermal) > BT_DEGREE_Q8 / 2,
    };
    // RELEASE speaks of what was left at that time: a finger that is pressed anew holds again.
    tare->released = tare->released && sweep.above < tare->left_pdc + BT_PDC_PRESSED;
    tare->left_pdc = (int16_t)bt_clamp(sweep.above, 0, tare->left_pdc);
    bt_release_verdict verdict = bt_release_judge(&tare->release, &tare->witness, &sweep);
    if (tare->held || verdict == BT_RELEASE_NO) {
        return;
    }
    // A press from which pressure comes back to the tare began at rest. If it stays above, the finger may
    // still hold what it was tared with; and if that goes, pressure will be far below, and the tare is lost.
    bool back = sweep.witness && tare->release.pdc_peak >= BT_PDC_PRESSED
                && (int32_t)bt_abs32(sweep.above) <= bt_pdc_missing_max(tare->release.pdc_peak);
    bool confirmed = verdict != BT_RELEASE_SHIFT && (back || tare->released);
    bool light = verdict == BT_RELEASE_SHIFT && sweep.above > BT_QUIET_PDC; // may be, of 0.1 or 0.2 N
    tare->unsure = tare->unsure && !confirmed;
    tare->likely = (tare->likely && !confirmed) || light;
    if (verdict == BT_RELEASE_SHIFT) {
        bt_adopt_shift(tare);
    } else if (verdict == BT_RELEASE_CLEAN) {
        bt_adopt_after_press(tare, BT_TARE_REASON_RELEASE);
    } else if (verdict == BT_RELEASE_RESIDUE || tare->released) {
        bt_adopt_after_press(tare, BT_TARE_REASON_RESIDUE);
    } else if (tare->state == BT_TARE_STATE_CONTACT) {
        bt_adopt_doubt(tare);
    }
}

// A tare that the host gave, and what the finger read in a sweep: at rest, or pressed as pressure and a
// pattern of the electrodes agree, or neither.
static bool fits(const bt_tare *tare)
{
    int32_t sum;
    uint32_t energy = distance_count2(&tare->sweep.mean_q3, 3, &tare->base, &sum);
    uint32_t uneven = energy - (uint32_t)((int64_t)sum * sum / BT_ELECTRODES);
    if (!tare->pressure_seen || tare->base.pdc_q16 == BT_TARE_UNKNOWN) {
        return energy < BT_CALM_COUNT2;
    }
    int32_t above = (tare->sweep.mean_q3.lane[BT_LANE_PDC] >> 3) - bt_baseline_count(tare->base.pdc_q16);
    uint64_t pressure2 = (uint64_t)((int64_t)above * above);
    bool rests = energy < BT_SETTLED_COUNT2 && above < BT_PDC_PRESSED && above > -BT_MISSING_PDC;
    bool pressed = above >= BT_PDC_PRESSED && uneven >= energy / PATTERN_SHARE
                   && uneven <= pressure2 * BT_FLAT_SHARE && pressure2 <= (uint64_t)uneven * BT_MOVES_SHARE;
    return rests || (pressed && !tare->aged);
}

static void end_touched_sweep(bt_tare *tare, const bt_tare_settings *settings)
{
    bt_thermal_follow(&tare->thermal, settings->thermal_gain_q16);
    bt_watch_wait(&tare->watch, &tare->sweep, tare->trigger.unknown);
    bool due = tare->watch.wait_sweeps == 1 && tare->sweep.still_sweeps >= BT_WATCH_SWEEPS;
    if (tare->watch.creeps == BT_CREEP_SWEEPS) {
        tare->drift.settled = 0;
    }
    if (due || tare->sweep.still_sweeps == BT_WATCH_SWEEPS) {
        bt_watch_return(&tare->watch, &tare->sweep, tare->trigger.unknown, BT_STILL_SPAN_Q3);
    }
    if (!tare->partial) { // else the sums mix electrodes served in different states
        act_on_release(tare);
    }
}

// How much of the sweep was drift, and what the next one follows by. Drift is seen only while pressure is
// level. In a touch, or in what the host says is one, also only once skin no longer creeps, and only if it is
// faint or clearly one way, because shear makes no pressure either. Until then known drift is taken to go on,
// and unknown drift is followed as well as possible.
static void judge_drift(bt_tare *tare)
{
    bt_watch *watch = &tare->watch;
    bool rests = tare->state == BT_TARE_STATE_REST;
    bool touched = tare->held || !rests;
    bool valid = rests || bt_watch_sees(watch, &tare->sweep);
    bool shown = rests ? !tare->witness.flat : tare->witness.moves; // or a load would pass for drift
    bool steady = rests ? watch->level_sweeps >= BT_LEVEL_SWEEPS : bt_watch_level(watch);
    bool level = valid && shown && !tare->partial && steady;
    bool creeps = touched && bt_watch_creeps(watch);
    uint32_t away_q16 = bt_abs32(watch->shared_q16);
    uint32_t sure_q16 = ALIKE_Q16 + (bt_abs32(tare->thermal.step_q16) >> 14 << 17);
    bool alike = (valid && watch->aligned && away_q16 > DRIFTED_Q16) || (watch->alike && away_q16 > sure_q16);
    if (alike) {
        tare->drifted_sweeps = DRIFTED_SWEEPS;
    } else if (!touched && tare->drifted_sweeps > 0) {
        tare->drifted_sweeps--;
    }
    watch->follows = level && touched && !(creeps && bt_drift_known(&tare->drift));
    if (level && !creeps) {
        bt_drift_learn(&tare->drift);
        bool faint = touched && watch->shared_q16 <= FAINT_Q16 && watch->shared_q16 >= -FAINT_Q16;
        tare->drift_q16 = bt_drift_step_q16(&tare->drift, faint ? watch->shared_q16 : 0);
    } else {
        tare->drift_q16 = bt_drift_unseen(&tare->drift, 1);
    }
    tare->drift.moved_q16 = 0;
    tare->drift_q16 += watch->follows ? bt_watch_drifts_q16(watch) : 0;
}

BT_NOINLINE void bt_judge_sweep(bt_tare *tare, const bt_tare_settings *settings)
{
    bt_watch_end(&tare->watch, tare->pressure_seen ? &tare->sweep.mean_q3.lane[BT_LANE_PDC] : NULL);
    judge_drift(tare);
    if (tare->state == BT_TARE_STATE_INIT) {
        if (tare->sweep.still_sweeps >= BT_TARE_STILL_SWEEPS) {
            // Measured before there is a threshold: a worn sensor's noise must not look like a touch.
            bt_noise_add(&tare->noise, tare->deviation_q6, settings->contact_energy_count2);
            bt_adopt_present(tare, BT_TARE_REASON_START);
            tare->unsure = true;
            tare->likely = false;
        }
    } else if (tare->state == BT_TARE_STATE_REST && !tare->partial) {
        bt_rollback_keep(&tare->rollback, &tare->base);
        if (!tare->partial_before) { // else its windows reach back into a touch
            bt_noise_add(&tare->noise, tare->deviation_q6, settings->contact_energy_count2);
        }
    } else if (bt_tare_touched(tare)) {
        end_touched_sweep(tare, settings);
    }
    if (tare->unchecked && tare->age_rounds >= 2 * BT_SWEEP_ROUNDS && tare->state != BT_TARE_STATE_INIT) {
        tare->unchecked = false;
        tare->unsure = !fits(tare);
        tare->likely = true;
    }
    tare->energy_count2 = 0;
    tare->sum_q4 = 0;
    tare->deviation_q6 = 0;
    tare->pressure_seen = false;
    tare->partial_before = tare->partial;
    tare->partial = false;
}
