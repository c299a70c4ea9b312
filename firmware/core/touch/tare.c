#include "touch/tare.h"

#include "fixed_point.h"

#include <stddef.h>
#include <string.h>

// Bounds of the machine, measured on real sensors; the settling rule comes from real recordings.
#define HITS         3          // rounds over the threshold that make a contact
#define SLEW_Q16     (8 * 328)  // a sweep; 0.5 count/s: drift is followed no faster, so a load is not
#define PDC_SLEW_Q16 (8 * 131)  // 0.2 count/s
#define PDC_SINK_Q16 (8 * 655)  // 1 count/s: no load takes pressure away
#define PDC_BACK_Q16 (8 * 2621) // 4 counts/s: an undershoot comes back within seconds
#define BACK_ROUNDS  400        // and after these is over
#define BACK_SHARE   64         // of the press's peak; a hundredth seen
#define UNDERSHOOT   16         // pressure that may be missing right after a press (9 seen); it comes back
#define SPAN_Q3      (12 * 8)   // means of still signals stay this close to where they came to rest
#define NOW_SPAN_Q3  (32 * 8)   // and their latest filtered count this close to the mean: ten sigmas
#define STILL_SWEEPS 2          // to tare from; the first one may hold what came before it
#define WATCH_SWEEPS 5          // after which what is read is where the signals came to rest

#define FAINT_Q16              (1 << 16) // what all electrodes have moved by, that may be drift
#define DRIFT_ROUNDS_PER_COUNT 400       // 15 counts/min, the worst drift measured
#define DRIFT_LIMIT            60000

_Static_assert((uint64_t)DRIFT_LIMIT *DRIFT_LIMIT <= UINT32_MAX, "the forgiven drift must fit 32 bits");

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

static int32_t pdc_above_tare(const bt_tare *tare)
{
    return tare->gate.smooth.lane[BT_LANE_PDC] - (int32_t)((tare->base.pdc_q16 + (1 << 15)) >> 16);
}

// The square of a difference in count^2, rounded down. Differences are below 2^16 in 1/16 count: as unsigned,
// the square fits, and so does the sum over all electrodes.
static uint32_t square(int32_t difference_q4)
{
    return (uint32_t)difference_q4 * (uint32_t)difference_q4 >> 8;
}

// ---- changes of the baseline ----------------------------------------------------------------

// What the gate compares with: in doubt where the signals came to rest, else the tare.
static const bt_baseline *gate_base(const bt_tare *tare)
{
    return tare->state == BT_TARE_STATE_DOUBT ? &tare->watch.base : &tare->base;
}

static void aim_electrode(bt_tare *tare, unsigned i)
{
    uint32_t base_q16 = gate_base(tare)->electrode_q16[i];
    if (base_q16 != BT_TARE_UNKNOWN && !(tare->gate.unknown >> i & 1)) {
        tare->gate.rest.lane[i] = (uint16_t)((base_q16 + (1 << 15)) >> 16);
    }
}

static void aim_pressure(bt_tare *tare)
{
    uint32_t base_q16 = tare->base.pdc_q16;
    uint32_t watched_q16 = gate_base(tare)->pdc_q16;
    // A press that ends in doubt has the pressure low for a second or two; its return is no touch.
    if (base_q16 != BT_TARE_UNKNOWN && watched_q16 != BT_TARE_UNKNOWN && watched_q16 > base_q16) {
        base_q16 = watched_q16;
    }
    if (!(tare->gate.unknown >> BT_LANE_PDC & 1)) {
        tare->gate.rest.lane[BT_LANE_PDC] =
            base_q16 == BT_TARE_UNKNOWN ? 0 : (uint16_t)((base_q16 + (1 << 15)) >> 16);
    }
}

static void use_electrode(bt_tare *tare, unsigned i)
{
    tare->electrode_q4[i] = bt_tare_q4(tare->base.electrode_q16[i]);
    aim_electrode(tare, i);
}

static void aim_gate(bt_tare *tare)
{
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        aim_electrode(tare, i);
    }
    aim_pressure(tare);
}

static void forget_contact(bt_tare *tare)
{
    tare->hits = 0;
    tare->contact_rounds = 0;
    tare->let_go = false;
    bt_release_begin(&tare->release);
    bt_thermal_begin(&tare->thermal);
    bt_watch_begin(&tare->watch);
}

// The host's word, or what the machine did.
static void tell(bt_tare *tare, uint8_t reason)
{
    tare->reason = reason;
    tare->changed = true;
    tare->age_rounds = 0;
}

static void adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason)
{
    tare->base = *base;
    tare->state = state;
    tare->tared = true;
    tare->comes_back_q16 = 0;
    tell(tare, reason);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        use_electrode(tare, i);
    }
    aim_pressure(tare);
    forget_contact(tare);
    bt_rollback_start(&tare->rollback, base);
    tare->partial = true;
}

// In place of a tare that may prove wrong.
static void replace(bt_tare *tare, const bt_baseline *base, uint8_t reason)
{
    bt_inverted_note(&tare->last, &tare->base, base);
    adopt(tare, base, BT_TARE_STATE_REST, reason);
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
    replace(tare, &base, reason);
}

// After a press: pressure that undershoots comes back, which must not look like a touch.
static void adopt_after_press(bt_tare *tare, uint8_t reason)
{
    uint32_t rest_q16 = tare->base.pdc_q16;
    uint32_t present = present_q16(tare, BT_LANE_PDC);
    int32_t undershoot = tare->release.pdc_peak / BACK_SHARE;
    adopt_present(tare, reason);
    tare->comes_back_q16 = (undershoot < UNDERSHOOT ? undershoot : UNDERSHOOT) << 16;
    if (rest_q16 != BT_TARE_UNKNOWN && present < rest_q16 && rest_q16 - present < UNDERSHOOT << 16) {
        tare->base.pdc_q16 = rest_q16;
        bt_rollback_start(&tare->rollback, &tare->base);
        aim_pressure(tare);
    }
}

// Pressure as it is, and every electrode by what all have moved: what is left of a pattern stays.
static void adopt_shift(bt_tare *tare)
{
    bt_baseline base = tare->base;
    int32_t shift_q16 = (int32_t)bt_div_round((int64_t)tare->sum_q4 * (1 << 12), BT_ELECTRODES);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = bt_baseline_moved(base.electrode_q16[i], shift_q16);
    }
    base.pdc_q16 = present_q16(tare, BT_LANE_PDC);
    replace(tare, &base, BT_TARE_REASON_SHIFT);
}

static void enter_doubt(bt_tare *tare)
{
    bt_watch_take(&tare->watch, &tare->sweep, tare->gate.unknown);
    tare->state = BT_TARE_STATE_DOUBT;
    tare->hits = 0;
    aim_gate(tare);
}

static void enter_contact(bt_tare *tare)
{
    tare->state = BT_TARE_STATE_CONTACT;
    tare->hits = 0;
    aim_gate(tare);
}

// A channel whose first word comes only now begins at rest: against any other baseline it would
// look like a contact. Not so one whose tare the host has set.
static void meet_lane(bt_tare *tare, unsigned lane)
{
    uint32_t first_q16 = (uint32_t)tare->gate.smooth.lane[lane] << 16;
    bt_sweep_meet(&tare->sweep, lane, tare->gate.smooth.lane[lane]);
    if (lane < BT_ELECTRODES) {
        if (tare->tared && tare->base.electrode_q16[lane] == BT_TARE_UNKNOWN) {
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
    aim_pressure(tare);
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

// By what moves the tare and the watched baseline alike.
static BT_NOINLINE void shift_electrode(bt_tare *tare, unsigned i, int32_t step_q16)
{
    tare->base.electrode_q16[i] = bt_baseline_moved(tare->base.electrode_q16[i], step_q16);
    tare->watch.base.electrode_q16[i] = bt_baseline_moved(tare->watch.base.electrode_q16[i], step_q16);
    use_electrode(tare, i);
}

// ---- the lanes whose turn it is -------------------------------------------------------------

// Only in a sweep that began at rest: a tare that was just set stays as given for a round at least, and
// of a touch nothing is followed.
static bool rests(const bt_tare *tare)
{
    return tare->state == BT_TARE_STATE_REST && tare->hits == 0 && !tare->partial;
}

// Where the host says that something is held, only drift.
static bool tracks(const bt_tare *tare)
{
    return rests(tare) && !tare->held;
}

static void shift_all(bt_tare *tare, int32_t step_q16)
{
    for (unsigned i = 0; i < BT_ELECTRODES && step_q16 != 0; i++) {
        shift_electrode(tare, i, step_q16);
        tare->partial = true;
    }
}

// Back from a silence. All electrodes alike: what each has of its own is less than the noise of so few
// rounds.
static BT_NOINLINE void resume(bt_tare *tare)
{
    bool touched = tare->state == BT_TARE_STATE_CONTACT || tare->state == BT_TARE_STATE_DOUBT;
    bool known = bt_drift_known(&tare->drift);
    shift_all(tare, bt_drift_unseen(&tare->drift, tare->silence.sweeps));
    if (touched && tare->gate.pressure_now) {
        int32_t step_q16 = bt_watch_resume(&tare->watch, &tare->silence, SPAN_Q3);
        shift_all(tare, known ? 0 : step_q16);
    }
}

static void serve_touched(bt_tare *tare, unsigned i, uint16_t mean_q3)
{
    int32_t away_q4 = 2 * mean_q3 - tare->electrode_q4[i];
    tare->energy_count2 += square(away_q4);
    tare->sum_q4 += away_q4;
    int32_t drift_q16 = tare->drift_q16;
    bool watched = tare->watch.wait_sweeps == 0 && tare->sweep.still_sweeps >= WATCH_SWEEPS;
    if (watched) {
        uint32_t watched_q16 = tare->watch.base.electrode_q16[i];
        bt_watch_side(&tare->watch, (uint32_t)mean_q3 << 13, watched_q16);
        drift_q16 = bt_watch_step_q16(&tare->watch, drift_q16, (uint32_t)mean_q3 << 13, watched_q16);
    }
    tare->drift.moved_q16 += drift_q16;
    drift_q16 += tare->thermal.step_q16;
    if (drift_q16 != 0) {
        shift_electrode(tare, i, drift_q16);
        if (watched
            && tare->watch.base.electrode_q16[i] != BT_TARE_UNKNOWN) { // or drift would look like motion
            tare->sweep.settled_q3.lane[i] = (uint16_t)(tare->watch.base.electrode_q16[i] >> 13);
        }
    }
}

static void serve_electrode(bt_tare *tare, unsigned i)
{
    uint16_t mean_q3 = bt_sweep_close(&tare->sweep, i, SPAN_Q3);
    uint32_t *base_q16 = &tare->base.electrode_q16[i];
    if (mean_q3 == BT_SWEEP_UNREAD_Q3) {
        return;
    }
    if (tare->state == BT_TARE_STATE_CONTACT || tare->state == BT_TARE_STATE_DOUBT) {
        serve_touched(tare, i, mean_q3);
        return;
    }
    // Where it is used, every round was below the threshold: the sum stays far below 2^32.
    int32_t away_q3 = 8 * tare->gate.smooth.lane[i] - mean_q3;
    tare->deviation_q6 += (uint32_t)(away_q3 * away_q3);
    bt_watch_side(&tare->watch, (uint32_t)mean_q3 << 13, *base_q16);
    uint32_t before_q16 = *base_q16;
    if (tracks(tare)) {
        *base_q16 = bt_baseline_follow(*base_q16, (uint32_t)mean_q3 << 13, SLEW_Q16);
    }
    if (rests(tare)) {
        int32_t drift_q16 = tare->drift_q16;
        if (tare->held) {
            drift_q16 = bt_watch_step_q16(&tare->watch, drift_q16, (uint32_t)mean_q3 << 13, *base_q16);
        }
        *base_q16 = bt_baseline_moved(*base_q16, drift_q16);
        tare->drift.moved_q16 += (int32_t)(*base_q16 - before_q16);
        use_electrode(tare, i);
    }
}

static void serve_pressure(bt_tare *tare)
{
    uint32_t mean_q16 = (uint32_t)bt_sweep_close(&tare->sweep, BT_LANE_PDC, SPAN_Q3) << 13;
    if (tracks(tare) && pdc_known(tare)) {
        uint32_t before_q16 = tare->base.pdc_q16;
        bool back = tare->age_rounds < BACK_ROUNDS && tare->comes_back_q16 > 0;
        int32_t slew_q16 = mean_q16 < before_q16 ? PDC_SINK_Q16 : back ? PDC_BACK_Q16 : PDC_SLEW_Q16;
        tare->base.pdc_q16 = bt_baseline_follow(before_q16, mean_q16, slew_q16);
        tare->comes_back_q16 -=
            mean_q16 > before_q16 && back ? (int32_t)(tare->base.pdc_q16 - before_q16) : 0;
        aim_pressure(tare);
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
    tare->let_go = false;
    if (tare->state == BT_TARE_STATE_DOUBT) {
        bt_watch_pause(&tare->watch);
        enter_contact(tare); // against the tare that was in doubt
        return;
    }
    bt_baseline before = *bt_rollback_before(&tare->rollback);
    bt_drift_revert(&tare->drift);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t since_q16 = bt_drift_over(&tare->drift, bt_rollback_sweeps(&tare->rollback));
        before.electrode_q16[i] = bt_baseline_moved(before.electrode_q16[i], since_q16);
    }
    adopt(tare, &before, BT_TARE_STATE_CONTACT, BT_TARE_REASON_ROLL_BACK);
}

static void follow_contact(bt_tare *tare)
{
    tare->contact_rounds++;
    if (pdc_known(tare)) {
        bt_release_pressure(&tare->release, pdc_above_tare(tare));
    }
}

static void lose_tare(bt_tare *tare)
{
    tell(tare, BT_TARE_REASON_INVERTED);
    tare->state = BT_TARE_STATE_INIT;
    tare->tared = false;
    tare->last.known = false;
    tare->hits = 0;
    tare->partial = true;
    bt_sweep_restart(&tare->sweep);
}

// A tare that was taken of a hold shows when that ends.
static BT_NOINLINE void look_inverted(bt_tare *tare)
{
    bt_tare_doubt doubt =
        bt_inverted_judge(&tare->last, &tare->gate.smooth, &tare->base, tare->release.pdc_peak);
    if (doubt == BT_TARE_UNDO) {
        bt_baseline before = tare->base;
        bt_inverted_undo(&tare->last, &before);
        tare->last.known = false;
        adopt(tare, &before, BT_TARE_STATE_CONTACT, BT_TARE_REASON_UNDONE);
    } else if (doubt == BT_TARE_LOSE) {
        lose_tare(tare);
    }
}

// Where drift and temperature went untracked: 15 counts a minute, the worst drift measured, while there is
// pressure to tell it from a load; and a third of what temperature was followed by may be wrong.
static uint32_t forgiven_count2(const bt_tare *tare)
{
    uint32_t rounds = tare->contact_rounds < DRIFT_LIMIT ? tare->contact_rounds : DRIFT_LIMIT;
    uint32_t drift_count2 = BT_DIVIDE_U32(rounds * rounds, DRIFT_ROUNDS_PER_COUNT * DRIFT_ROUNDS_PER_COUNT);
    uint32_t warm_count = bt_abs32(tare->thermal.applied_q16) >> 16;
    return BT_ELECTRODES
           * ((tare->pressure_seen ? drift_count2 : 0) + BT_DIVIDE_U32(warm_count * warm_count, 9));
}

// What is left of the energy when every electrode loses what all have moved. A 19th is a product and a shift;
// it is off by less than a millionth.
static uint32_t uneven_count2(const bt_tare *tare)
{
    uint64_t sum_q4 = bt_abs32(tare->sum_q4);
    uint32_t even_count2 = (uint32_t)((sum_q4 * sum_q4 >> 8) * 220753 >> 22);
    return tare->energy_count2 > even_count2 ? tare->energy_count2 - even_count2 : 0;
}

// After a sweep in contact: has it ended? What would be tared are means, and in the rounds right after a
// release they still are those of the press: the pressure and its mean must both have fallen.
static void judge_release(bt_tare *tare)
{
    int32_t mean = tare->sweep.mean_q3.lane[BT_LANE_PDC] >> 3;
    int32_t now = tare->gate.smooth.lane[BT_LANE_PDC];
    bt_release_sweep sweep = {
        .energy_count2 = tare->energy_count2,
        .uneven_count2 = uneven_count2(tare),
        .forgiven_count2 = forgiven_count2(tare),
        .pressure = tare->pressure_seen && tare->base.pdc_q16 != BT_TARE_UNKNOWN,
        .above = (mean > now ? mean : now) - (int32_t)((tare->base.pdc_q16 + (1 << 15)) >> 16),
        .still_sweeps = tare->sweep.still_sweeps,
        .level_sweeps = tare->watch.level_sweeps,
    };
    bt_release_verdict verdict = bt_release_judge(&tare->release, &sweep);
    if (tare->held || verdict == BT_RELEASE_NO) {
        return;
    }
    if (verdict == BT_RELEASE_SHIFT) {
        adopt_shift(tare);
    } else if (verdict == BT_RELEASE_CLEAN) {
        adopt_after_press(tare, BT_TARE_REASON_RELEASE);
    } else if (verdict == BT_RELEASE_RESIDUE || tare->let_go) {
        adopt_after_press(tare, BT_TARE_REASON_RESIDUE);
    } else if (tare->state == BT_TARE_STATE_CONTACT) {
        enter_doubt(tare);
    }
}

static void end_touched_sweep(bt_tare *tare, const bt_tare_settings *settings)
{
    bt_thermal_follow(&tare->thermal, settings->thermal_gain_q16);
    bool rests = tare->sweep.still_sweeps >= WATCH_SWEEPS;
    if (tare->watch.wait_sweeps > 1) {
        tare->watch.wait_sweeps--;
    }
    bool due = tare->watch.wait_sweeps == 1 && rests;
    if (bt_watch_crept(&tare->watch)) {
        tare->drift.settled = 0;
    }
    if (due || tare->sweep.still_sweeps == WATCH_SWEEPS) {
        bt_watch_return(&tare->watch, &tare->sweep, tare->gate.unknown, SPAN_Q3);
    }
    if (!tare->partial) { // sums over electrodes that were not all served in one state say nothing
        judge_release(tare);
    }
}

// What of the sweep was drift, and what the next one follows by. While pressure is level; of a touch, or what
// the host says is one, only once skin no longer creeps, and either what is faint or what has clearly gone
// one way: shear makes no pressure, either. Until then it goes on as it was, or is followed as well as may be
// if that is not known.
static void judge_drift(bt_tare *tare, int32_t warming_q16)
{
    bt_watch *watch = &tare->watch;
    bool rests = tare->state == BT_TARE_STATE_REST;
    bool touched = tare->held || !rests;
    bool valid = rests || (watch->wait_sweeps == 0 && tare->sweep.still_sweeps >= WATCH_SWEEPS);
    bool level = valid && !tare->partial && bt_watch_level(watch);
    bool creeps = touched && bt_watch_creeps(watch);
    if (level && !creeps) {
        bt_drift_learn(&tare->drift, touched ? 0 : warming_q16);
    } else if (!bt_watch_level(watch)) {
        bt_drift_revert(&tare->drift);
    }
    tare->drift.moved_q16 = 0;
    watch->follows = level && touched && !(creeps && bt_drift_known(&tare->drift));
    int32_t away_q16 = level && !creeps ? watch->shared_q16 : 0;
    if (touched && (away_q16 > FAINT_Q16 || away_q16 < -FAINT_Q16)) {
        away_q16 = 0;
    }
    tare->drift_q16 = level ? bt_drift_step_q16(&tare->drift, away_q16) : bt_drift_unseen(&tare->drift, 1);
    tare->drift_q16 += watch->follows ? bt_watch_drifts_q16(watch) : 0;
    tare->drift_q16 += touched ? 0 : warming_q16; // of a touch the thermal term tells
}

static BT_NOINLINE void end_sweep(bt_tare *tare, const bt_tare_settings *settings)
{
    bt_watch_end(&tare->watch, tare->pressure_seen ? &tare->sweep.mean_q3.lane[BT_LANE_PDC] : NULL);
    judge_drift(tare, bt_thermal_rate_q16(&tare->thermal, settings->thermal_gain_q16));
    if (tare->state == BT_TARE_STATE_INIT) {
        if (tare->sweep.still_sweeps >= STILL_SWEEPS && !tare->held) {
            // Measured before there is a threshold: a worn sensor's noise must not look like a touch.
            bt_noise_add(&tare->noise, tare->deviation_q6, settings->contact_energy_count2);
            adopt_present(tare, BT_TARE_REASON_START);
        }
    } else if (tare->state == BT_TARE_STATE_REST && !tare->partial) {
        bt_rollback_keep(&tare->rollback, &tare->base);
        if (!tare->partial_before) { // or its windows reach back into a touch
            bt_noise_add(&tare->noise, tare->deviation_q6, settings->contact_energy_count2);
        }
    } else if (tare->state == BT_TARE_STATE_CONTACT || tare->state == BT_TARE_STATE_DOUBT) {
        end_touched_sweep(tare, settings);
    }
    tare->energy_count2 = 0;
    tare->sum_q4 = 0;
    tare->deviation_q6 = 0;
    tare->pressure_seen = false;
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
    bool resting = tare->state == BT_TARE_STATE_REST || tare->state == BT_TARE_STATE_DOUBT;
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

void bt_tare_end(bt_tare *tare, uint32_t t_us, const bt_tare_settings *settings)
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
        tare->state = tare->tared ? tare->before_fault : BT_TARE_STATE_INIT;
        aim_gate(tare);
        tare->release.quiet_sweeps = 0;
    } else if (tare->state == BT_TARE_STATE_REST || tare->state == BT_TARE_STATE_DOUBT) {
        if (tare->gate.room < 0) {
            count_hit(tare);
        } else {
            tare->hits = 0;
        }
    }
    if (tare->gate.pressure_now && tare->tared && pdc_above_tare(tare) < 0) {
        look_inverted(tare);
    }
    if (tare->state == BT_TARE_STATE_CONTACT || tare->state == BT_TARE_STATE_DOUBT) {
        follow_contact(tare);
    }
    tare->pressure_seen = tare->pressure_seen || tare->gate.pressure_now;
    if (bt_silence_add(&tare->silence, t_us, &tare->gate.smooth)) {
        resume(tare);
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
    replace(tare, base, BT_TARE_REASON_HOST_SET);
    tare->last.known = false; // the host knows better than what was there before
    return BT_ERROR_OK;
}

void bt_tare_hold(bt_tare *tare)
{
    tare->let_go = false;
    if (tare->held) {
        return;
    }
    tare->held = true;
    if (tare->state == BT_TARE_STATE_DOUBT) {
        enter_contact(tare);
    }
    tell(tare, BT_TARE_REASON_HOST_HOLD);
}

void bt_tare_release(bt_tare *tare)
{
    tare->held = false;
    tare->let_go = true;
    tell(tare, BT_TARE_REASON_HOST_RELEASE);
}

void bt_tare_lapse(bt_tare *tare)
{
    tare->held = false;
    tell(tare, BT_TARE_REASON_HOLD_LAPSED);
}
