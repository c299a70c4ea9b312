#include "touch/tare.h"

#include "fixed_point.h"

#include <string.h>

// Bounds of the machine, measured on real sensors; the settling rule comes from real recordings.
#define HITS         3         // rounds over the threshold that make a contact
#define SLEW_Q16     (8 * 328) // a sweep; 0.5 count/s: drift is followed no faster, so a load is not
#define PDC_SLEW_Q16 (8 * 131) // 0.2 count/s
#define SPAN_Q3      (12 * 8)  // means of still signals stay this close to where they came to rest
#define NOW_SPAN_Q3  (32 * 8)  // and their latest filtered count this close to the mean: ten sigmas
#define STILL_SWEEPS 2         // to tare from; the first one may hold what came before it

bt_tare_settings bt_tare_settings_from(const bt_settings *settings)
{
    return (bt_tare_settings){
        .contact_energy_count2 = (uint32_t)bt_settings_get(settings, BT_SETTING_CONTACT_ENERGY_COUNT2),
        .thermal_gain_q16 = bt_thermal_gain_q16(bt_settings_get(settings, BT_SETTING_THERMAL_GAIN_MILLI)),
    };
}

// ---- measures against the baseline ----------------------------------------------------------

static bool pdc_known(const bt_tare *tare)
{
    return tare->gate.pressure_now && tare->base.pdc_q16 != BT_TARE_UNKNOWN;
}

static int32_t pdc_above_rest(const bt_tare *tare)
{
    return tare->gate.smooth.lane[BT_LANE_PDC] - tare->gate.rest.lane[BT_LANE_PDC];
}

// The square of a difference in count^2, rounded down. Differences are below 2^16 in 1/16 count: as unsigned,
// the square fits, and so does the sum over all electrodes.
static uint32_t square(int32_t difference_q4)
{
    return (uint32_t)difference_q4 * (uint32_t)difference_q4 >> 8;
}

// ---- changes of the baseline ----------------------------------------------------------------

static void use_electrode(bt_tare *tare, unsigned i)
{
    uint32_t base_q16 = tare->base.electrode_q16[i];
    tare->electrode_q4[i] = bt_tare_q4(base_q16);
    if (base_q16 != BT_TARE_UNKNOWN && !(tare->gate.unknown >> i & 1)) {
        tare->gate.rest.lane[i] = (uint16_t)((base_q16 + (1 << 15)) >> 16);
    }
}

static void use_pressure(bt_tare *tare)
{
    uint32_t base_q16 = tare->base.pdc_q16;
    if (!(tare->gate.unknown >> BT_LANE_PDC & 1)) {
        tare->gate.rest.lane[BT_LANE_PDC] =
            base_q16 == BT_TARE_UNKNOWN ? 0 : (uint16_t)((base_q16 + (1 << 15)) >> 16);
    }
}

static void forget_contact(bt_tare *tare)
{
    tare->hits = 0;
    tare->contact_rounds = 0;
    bt_release_begin(&tare->release);
    bt_thermal_begin(&tare->thermal);
}

static void adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason)
{
    tare->base = *base;
    tare->state = state;
    tare->reason = reason;
    tare->changed = true;
    tare->age_rounds = 0;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        use_electrode(tare, i);
    }
    use_pressure(tare);
    forget_contact(tare);
    bt_rollback_start(&tare->rollback, base);
    tare->partial = true;
}

static uint32_t present_q16(const bt_tare *tare, unsigned lane)
{
    bool unknown = tare->gate.unknown >> lane & 1;
    return unknown ? BT_TARE_UNKNOWN : (uint32_t)tare->sweep.mean_q3.lane[lane] << 13;
}

static void adopt_present(bt_tare *tare, uint8_t reason)
{
    bt_baseline base;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = present_q16(tare, i);
    }
    base.pdc_q16 = present_q16(tare, BT_LANE_PDC);
    adopt(tare, &base, BT_TARE_STATE_REST, reason);
}

// A channel whose first word comes only now begins at rest: against any other baseline it would
// look like a contact. Not so one whose tare the host has set.
static void meet_lane(bt_tare *tare, unsigned lane)
{
    uint32_t first_q16 = (uint32_t)tare->gate.smooth.lane[lane] << 16;
    bool tared = tare->reason != BT_TARE_REASON_NONE;
    bt_sweep_meet(&tare->sweep, lane, tare->gate.smooth.lane[lane]);
    if (lane < BT_ELECTRODES) {
        if (tared && tare->base.electrode_q16[lane] == BT_TARE_UNKNOWN) {
            tare->base.electrode_q16[lane] = first_q16;
            bt_rollback_meet(&tare->rollback, lane, first_q16);
        }
        use_electrode(tare, lane);
        return;
    }
    if (tare->state == BT_TARE_STATE_REST && tare->base.pdc_q16 == BT_TARE_UNKNOWN) {
        tare->base.pdc_q16 = first_q16;
        bt_rollback_meet(&tare->rollback, lane, first_q16);
    }
    use_pressure(tare);
}

static BT_NOINLINE void meet(bt_tare *tare)
{
    for (unsigned lane = 0; tare->gate.met >> lane != 0; lane++) {
        if (tare->gate.met >> lane & 1) {
            meet_lane(tare, lane);
        }
    }
    tare->gate.met = 0;
}

// ---- temperature ----------------------------------------------------------------------------

void bt_tare_temperature(bt_tare *tare, uint16_t tdc)
{
    bt_thermal_add(&tare->thermal, tdc, tare->sweep.round == BT_SWEEP_ROUNDS - 1);
}

static BT_NOINLINE void warm_electrode(bt_tare *tare, unsigned i)
{
    int32_t warmed_q16 = (int32_t)tare->base.electrode_q16[i] + tare->thermal.step_q16;
    int32_t top_q16 = BT_FULL_SCALE_COUNT << 16;
    warmed_q16 = warmed_q16 < 0 ? 0 : warmed_q16 > top_q16 ? top_q16 : warmed_q16;
    tare->base.electrode_q16[i] = (uint32_t)warmed_q16;
    use_electrode(tare, i);
}

// ---- the lanes whose turn it is -------------------------------------------------------------

// Only in a sweep that began at rest: a tare that was just set stays as given for a round at least, and
// of a touch nothing is followed.
static bool tracks(const bt_tare *tare)
{
    return tare->state == BT_TARE_STATE_REST && tare->hits == 0 && !tare->partial;
}

static void serve_electrode(bt_tare *tare, unsigned i)
{
    uint16_t mean_q3 = bt_sweep_close(&tare->sweep, i, SPAN_Q3);
    uint32_t *base_q16 = &tare->base.electrode_q16[i];
    if (mean_q3 == BT_SWEEP_UNREAD_Q3) {
        return;
    }
    if (tare->state == BT_TARE_STATE_CONTACT) {
        tare->energy_count2 += square(2 * mean_q3 - tare->electrode_q4[i]);
        if (tare->thermal.step_q16 != 0) {
            warm_electrode(tare, i);
        }
        return;
    }
    // Where it is used, every round was below the threshold: the sum stays far below 2^32.
    int32_t away_q3 = 8 * tare->gate.smooth.lane[i] - mean_q3;
    tare->deviation_q6 += (uint32_t)(away_q3 * away_q3);
    if (tracks(tare)) {
        *base_q16 = bt_baseline_follow(*base_q16, (uint32_t)mean_q3 << 13, SLEW_Q16);
        use_electrode(tare, i);
    }
}

static void serve_pressure(bt_tare *tare)
{
    uint16_t mean_q3 = bt_sweep_close(&tare->sweep, BT_LANE_PDC, SPAN_Q3);
    if (tracks(tare) && pdc_known(tare)) {
        tare->base.pdc_q16 = bt_baseline_follow(tare->base.pdc_q16, (uint32_t)mean_q3 << 13, PDC_SLEW_Q16);
        use_pressure(tare);
    }
}

static void serve(bt_tare *tare)
{
    unsigned end = bt_sweep_end(&tare->sweep);
    for (unsigned lane = bt_sweep_first(&tare->sweep); lane < end; lane++) {
        if (lane < BT_ELECTRODES) {
            serve_electrode(tare, lane);
        } else {
            serve_pressure(tare);
        }
    }
}

// ---- states ---------------------------------------------------------------------------------

static BT_NOINLINE void count_hit(bt_tare *tare)
{
    tare->partial = true;
    if (++tare->hits < HITS) {
        return;
    }
    bt_baseline before = *bt_rollback_before(&tare->rollback);
    adopt(tare, &before, BT_TARE_STATE_CONTACT, BT_TARE_REASON_ROLL_BACK);
}

static void follow_contact(bt_tare *tare)
{
    tare->contact_rounds++;
    if (pdc_known(tare)) {
        bt_release_pressure(&tare->release, pdc_above_rest(tare));
    }
}

// After a sweep in contact: has it ended? What would be tared are means, and in the rounds right after a
// release they still are those of the press: the pressure and its mean must both have fallen.
static void judge_release(bt_tare *tare)
{
    int32_t mean = tare->sweep.mean_q3.lane[BT_LANE_PDC] >> 3;
    int32_t now = tare->gate.smooth.lane[BT_LANE_PDC];
    bt_release_sweep sweep = {
        .energy_count2 = tare->energy_count2,
        .contact_rounds = tare->contact_rounds,
        .above = (mean > now ? mean : now) - tare->gate.rest.lane[BT_LANE_PDC],
        .still_sweeps = tare->sweep.still_sweeps,
    };
    uint8_t reason = bt_release_judge(&tare->release, &sweep);
    if (reason != BT_TARE_REASON_NONE) {
        adopt_present(tare, reason);
    }
}

static BT_NOINLINE void end_sweep(bt_tare *tare, const bt_tare_settings *settings)
{
    // Sums over electrodes that were not all served in one state say nothing.
    bool whole = !tare->partial;
    if (tare->state == BT_TARE_STATE_INIT) {
        if (tare->sweep.still_sweeps >= STILL_SWEEPS) {
            // Measured before there is a threshold: a worn sensor's noise must not look like a touch.
            bt_noise_add(&tare->noise, tare->deviation_q6, settings->contact_energy_count2);
            adopt_present(tare, BT_TARE_REASON_START);
        }
    } else if (tare->state == BT_TARE_STATE_REST && whole) {
        bt_rollback_keep(&tare->rollback, &tare->base);
        if (!tare->partial_before) { // or its windows reach back into a touch
            bt_noise_add(&tare->noise, tare->deviation_q6, settings->contact_energy_count2);
        }
    } else if (tare->state == BT_TARE_STATE_CONTACT) {
        bt_thermal_follow(&tare->thermal, settings->thermal_gain_q16);
        if (whole) {
            judge_release(tare);
        }
    }
    tare->energy_count2 = 0;
    tare->deviation_q6 = 0;
    tare->release.pressure_seen = false;
    tare->partial_before = tare->partial;
    tare->partial = false;
}

// Nothing of a faulty round may reach a tare: the sweep starts over when it clears.
static BT_NOINLINE void fault(bt_tare *tare)
{
    if (tare->state != BT_TARE_STATE_FAULT) {
        tare->before_fault = tare->state;
    }
    if (tare->state == BT_TARE_STATE_REST) {
        bt_thermal_begin(&tare->thermal); // the tare that is frozen now holds for the temperature of now
    }
    tare->thermal.step_q16 = 0; // some lanes have had it: rather lost for the others than twice for these
    tare->state = BT_TARE_STATE_FAULT;
    tare->hits = 0;
    tare->partial = true;
    bt_sweep_restart(&tare->sweep);
}

// ---- a round --------------------------------------------------------------------------------

void bt_tare_reset(bt_tare *tare)
{
    memset(tare, 0, sizeof *tare);
    bt_gate_reset(&tare->gate);
    bt_sweep_restart(&tare->sweep);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        tare->base.electrode_q16[i] = BT_TARE_UNKNOWN;
        tare->electrode_q4[i] = BT_INVALID_COUNT;
    }
    tare->base.pdc_q16 = BT_TARE_UNKNOWN;
}

void bt_tare_begin(bt_tare *tare, const bt_tare_settings *settings)
{
    if (tare->sweep.round == 0) { // the noise is as old as the last sweep
        tare->threshold_count2 = bt_noise_threshold(&tare->noise, settings->contact_energy_count2);
    }
    bool resting = tare->state == BT_TARE_STATE_REST;
    bt_gate_begin(&tare->gate, resting ? (int32_t)tare->threshold_count2 : BT_GATE_NEVER);
    tare->touched = tare->hits > 0; // what has begun is not seen to begin again
}

bool bt_tare_touch(bt_tare *tare)
{
    bool first = !tare->touched;
    tare->touched = true;
    return first;
}

bool bt_tare_pressure(bt_tare *tare, uint16_t count)
{
    return bt_gate_pressure(&tare->gate, count, BT_PDC_HIT) < 0 && bt_tare_touch(tare);
}

void bt_tare_end(bt_tare *tare, const bt_tare_settings *settings)
{
    tare->changed = false;
    tare->age_rounds++;
    if (bt_tare_faulty(tare)) {
        fault(tare);
        return;
    }
    if (tare->gate.met != 0) {
        meet(tare);
    }
    if (tare->state == BT_TARE_STATE_FAULT) {
        // A tare from before the fault still holds, and the gate sees by the coming words whether something
        // touches now: lost words are no touch.
        tare->state = tare->reason == BT_TARE_REASON_NONE ? BT_TARE_STATE_INIT : tare->before_fault;
        tare->release.quiet_sweeps = 0;
    } else if (tare->state == BT_TARE_STATE_REST) {
        if (tare->gate.room < 0) {
            count_hit(tare);
        } else {
            tare->hits = 0;
        }
    }
    if (tare->state == BT_TARE_STATE_CONTACT) {
        follow_contact(tare);
    }
    bt_sweep_add(&tare->sweep, &tare->gate.smooth);
    serve(tare);
    if (bt_sweep_next(&tare->sweep)) {
        end_sweep(tare, settings);
    }
}

// ---- host commands --------------------------------------------------------------------------

// Means are up to two sweeps old: what the signals do now must agree with them.
static bool present_is_still(const bt_tare *tare)
{
    bool still = tare->sweep.still_sweeps >= STILL_SWEEPS;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int change_q3 = 8 * tare->gate.smooth.lane[i] - tare->sweep.mean_q3.lane[i];
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
    adopt_present(tare, BT_TARE_REASON_HOST_NOW);
    return BT_ERROR_OK;
}

uint8_t bt_tare_set(bt_tare *tare, const bt_baseline *base)
{
    if (tare->state == BT_TARE_STATE_FAULT) {
        return BT_ERROR_RAILED;
    }
    adopt(tare, base, BT_TARE_STATE_REST, BT_TARE_REASON_HOST_SET);
    return BT_ERROR_OK;
}
