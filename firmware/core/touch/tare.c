#include "touch/tare.h"

#include "touch/adopt.h"
#include "touch/follow.h"
#include "touch/judge.h"

#include "fixed_point.h"

#include <string.h>

#define FRESH_MS    600000   // age of a host's tare
#define NOW_SPAN_Q3 (32 * 8) // from a still signal's latest filtered count to the mean: ten sigmas

bt_tare_settings bt_tare_settings_from(const bt_settings *settings)
{
    return (bt_tare_settings){
        .contact_energy_count2 = (uint32_t)bt_settings_get(settings, BT_SETTING_CONTACT_ENERGY_COUNT2),
        .thermal_gain_q16 = bt_thermal_gain_q16(bt_settings_get(settings, BT_SETTING_THERMAL_GAIN_MILLI)),
    };
}

void bt_tare_temperature(bt_tare *tare, uint16_t tdc)
{
    bt_thermal_add(&tare->thermal, tdc, tare->sweep.round == BT_SWEEP_ROUNDS - 1);
}

// ---- states ---------------------------------------------------------------------------------

static BT_NOINLINE void count_hit(bt_tare *tare, const bt_tare_settings *settings)
{
    tare->partial = true;
    if (++tare->hits < BT_CONTACT_ROUNDS) {
        return;
    }
    tare->released = false;
    if (tare->state == BT_TARE_STATE_DOUBT) {
        bt_watch_pause(&tare->watch);
        bt_adopt_contact(tare); // against the tare in doubt
        return;
    }
    bt_baseline before = *bt_rollback_before(&tare->rollback);
    bt_drift_revert(&tare->drift);
    uint32_t rested = bt_rollback_sweeps(&tare->rollback);
    int32_t since_q16 = bt_drift_over(&tare->drift, rested);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        before.electrode_q16[i] = bt_baseline_moved(before.electrode_q16[i], since_q16);
    }
    bt_drift_remove_warming(&tare->drift, bt_thermal_rate_q16(&tare->thermal, settings->thermal_gain_q16));
    bt_adopt(tare, &before, BT_TARE_STATE_CONTACT, BT_TARE_REASON_ROLL_BACK);
    tare->release.found = rested == 0 && bt_tare_pdc_known(tare) && bt_tare_pdc_above(tare) >= BT_PDC_PRESSED;
}

// No faulty round may enter a tare: the sweep goes on without it. The sweep starts over if another fault or
// anything else has broken it before: a sweep with frequent losses must not enter the history.
static BT_NOINLINE void fault(bt_tare *tare)
{
    if (tare->state != BT_TARE_STATE_FAULT) {
        tare->before_fault = tare->state;
    }
    if (tare->state == BT_TARE_STATE_REST) {
        bt_thermal_begin(&tare->thermal); // the tare is frozen at this temperature
    }
    tare->thermal.step_q16 = 0; // some lanes have it already: better lost for the others than added twice
    tare->state = BT_TARE_STATE_FAULT;
    tare->hits = 0;
    if (tare->partial) {
        bt_sweep_restart(&tare->sweep);
    }
    tare->partial = true;
}

// ---- a round --------------------------------------------------------------------------------

void bt_tare_reset(bt_tare *tare)
{
    memset(tare, 0, sizeof *tare);
    bt_trigger_reset(&tare->trigger);
    bt_sweep_restart(&tare->sweep);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        tare->electrode_q4[i] = BT_INVALID_COUNT;
    }
    memset(&tare->base, 0xFF, sizeof tare->base); // BT_TARE_UNKNOWN
}

void bt_tare_begin(bt_tare *tare, const bt_tare_settings *settings)
{
    if (tare->sweep.round == 0) { // the noise changes with a sweep only
        tare->threshold_count2 = bt_noise_threshold(&tare->noise, settings->contact_energy_count2);
    }
    bool resting = tare->state == BT_TARE_STATE_REST || tare->state == BT_TARE_STATE_DOUBT;
    bt_trigger_begin(&tare->trigger, resting ? (int32_t)tare->threshold_count2 : BT_TRIGGER_NEVER);
    tare->touched = tare->hits > 0; // a touch under way is no new one
}

bool bt_tare_touch(bt_tare *tare)
{
    bool first = !tare->touched;
    tare->touched = true;
    return first;
}

bool bt_tare_pressure(bt_tare *tare, uint16_t count)
{
    return bt_trigger_pressure(&tare->trigger, count, BT_PDC_HIT) < 0 && bt_tare_touch(tare);
}

void bt_tare_end(bt_tare *tare, uint32_t t_us, const bt_tare_settings *settings)
{
    tare->changed = false;
    tare->age_rounds++;
    if (bt_tare_faulty(tare)) {
        fault(tare);
        return;
    }
    if (tare->trigger.first_words != 0) {
        bt_adopt_first_words(tare);
    }
    if (tare->state == BT_TARE_STATE_FAULT) {
        // A tare from before the fault still holds. The coming words show whether something touches now: lost
        // words are no touch.
        tare->state = tare->tared ? tare->before_fault : BT_TARE_STATE_INIT;
        bt_adopt_aim(tare);
        tare->release.quiet_sweeps = 0;
    } else if (tare->state == BT_TARE_STATE_REST || tare->state == BT_TARE_STATE_DOUBT) {
        if (tare->trigger.room < 0) {
            count_hit(tare, settings);
        } else {
            tare->hits = 0;
        }
    }
    if (tare->trigger.pressure_now && tare->tared && bt_tare_pdc_above(tare) < 0) {
        bt_judge_inverted(tare);
    }
    if (bt_tare_touched(tare)) {
        tare->contact_rounds++;
        if (bt_tare_pdc_known(tare)) {
            bt_release_pressure(&tare->release, bt_tare_pdc_above(tare));
            bt_judge_felt(tare);
        }
    }
    tare->pressure_seen = tare->pressure_seen || tare->trigger.pressure_now;
    if (bt_silence_add(&tare->silence, t_us, &tare->trigger.smooth)) {
        bt_follow_resume(tare);
    }
    bt_sweep_add(&tare->sweep, &tare->trigger.smooth);
    bt_follow_turn(tare);
    if (bt_sweep_next(&tare->sweep)) {
        bt_judge_sweep(tare, settings);
    }
}

// ---- host commands --------------------------------------------------------------------------

// Means are up to two sweeps old, so the present signals must agree with them.
static bool present_is_still(const bt_tare *tare)
{
    bool still = tare->sweep.still_sweeps >= BT_TARE_STILL_SWEEPS;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int change_q3 = 8 * tare->trigger.smooth.lane[i] - tare->sweep.mean_q3.lane[i];
        still = still && change_q3 <= NOW_SPAN_Q3 && change_q3 >= -NOW_SPAN_Q3;
    }
    return still;
}

uint8_t bt_tare_now(bt_tare *tare)
{
    if (tare->state == BT_TARE_STATE_FAULT) {
        return BT_ERROR_RAILED;
    }
    if (!present_is_still(tare)) {
        return BT_ERROR_NOT_STILL;
    }
    // Only a release confirms a tare: without one it is likely, and under pressure it holds a load.
    bool pressed =
        bt_tare_touched(tare) && bt_tare_pdc_known(tare) && bt_tare_pdc_above(tare) >= BT_PDC_PRESSED;
    // A tare that pressure contradicted stays unsure however often it is renewed: it still holds a load.
    bool again = tare->unsure && tare->likely && tare->state == BT_TARE_STATE_REST;
    tare->likely = tare->likely || tare->unsure || tare->state != BT_TARE_STATE_REST;
    tare->unsure = again || (pressed && !tare->witness.flat);
    bt_adopt_present(tare, BT_TARE_REASON_HOST_NOW);
    return BT_ERROR_OK;
}

uint8_t bt_tare_set(bt_tare *tare, const bt_baseline *base, uint32_t age_ms)
{
    if (tare->state == BT_TARE_STATE_FAULT) {
        return BT_ERROR_RAILED;
    }
    bt_adopt(tare, base, BT_TARE_STATE_REST, BT_TARE_REASON_HOST_SET);
    tare->unsure = true; // until bt_judge_sweep has compared it
    tare->unchecked = true;
    tare->aged = age_ms > FRESH_MS;
    return BT_ERROR_OK;
}

void bt_tare_keep(const bt_tare *tare, bt_tare_kept *kept)
{
    *kept = (bt_tare_kept){
        .base = tare->base,
        .drift_q20 = tare->drift.sure.q20,
        .drift_sweeps = tare->drift.sure.sweeps,
        .held = tare->held,
        .unsure = tare->unsure,
        .likely = tare->likely,
    };
}

void bt_tare_restore(bt_tare *tare, const bt_tare_kept *kept)
{
    bt_adopt(tare, &kept->base, BT_TARE_STATE_REST, BT_TARE_REASON_RESTORED);
    tare->drift.sure = (bt_drift_rate){kept->drift_q20, kept->drift_sweeps};
    bt_drift_revert(&tare->drift);
    tare->held = kept->held;
    tare->unsure = kept->unsure;
    tare->likely = kept->likely;
}

void bt_tare_hold(bt_tare *tare)
{
    tare->released = false;
    if (tare->held) {
        return;
    }
    tare->held = true;
    if (tare->state == BT_TARE_STATE_DOUBT) {
        bt_adopt_contact(tare);
    }
    bt_adopt_report(tare, BT_TARE_REASON_HOST_HOLD);
}

// A whole sweep must decide after a hold: a verdict in the coming round would replace the reason before it is
// sent, and the host's command would go unreported.
static void end_hold(bt_tare *tare, uint8_t reason)
{
    tare->held = false;
    tare->partial = true;
    bt_adopt_report(tare, reason);
}

void bt_tare_release(bt_tare *tare)
{
    tare->released = true;
    tare->left_pdc = BT_FULL_SCALE_COUNT;
    if (tare->unsure && tare->state == BT_TARE_STATE_REST) {
        tare->unsure = false;
        tare->likely = true;
    }
    end_hold(tare, BT_TARE_REASON_HOST_RELEASE);
}

void bt_tare_lapse(bt_tare *tare)
{
    end_hold(tare, BT_TARE_REASON_HOLD_LAPSED);
}
