#include "tare.h"

#include "fix.h"

#include <string.h>

// Frame counts and bounds of the machine (measured on real sensors; the settling rule comes from
// real recordings). 100 frames are one second.
#define STILL_SPAN      32        // counts an electrode may move in a window to tare from: six noise sigmas
#define HITS            3         // frames over the threshold that make a contact
#define PDC_HIT_Q16     (6 << 16) // pressure above rest that is a contact
#define PDC_QUIET_Q16   (4 << 16) // pressure above rest that still is a release; one-sided, it undershoots
#define SLEW_Q16        328       // 0.5 count/s: drift is followed no faster, so a load is not
#define PDC_SLEW_Q16    131       // 0.2 count/s
#define SNAPSHOT_FRAMES 25
#define ROLL_BACK       4 // snapshots: at least one second before the contact was seen
#define CALM_ENERGY     400
#define CALM_FRAMES     10
#define RESIDUE_ENERGY  6000 // count^2 that skin hysteresis may leave
#define RESIDUE_MOTION  800
#define RESIDUE_FRAMES  100
#define SETTLE_SPAN_Q16 (12 << 16) // counts; settled signals stay this close to where they came to rest
#define SETTLE_PDC_SPAN 4
#define SETTLE_FRAMES   40
#define SETTLE_PDC_Q16  (30 << 16)  // pressure that real skin keeps after a press (+24 seen), not more
#define RELEASE_FALL    4           // a release has fallen to a quarter of the contact's peak
#define NOISE_SHIFT     6           // the noise estimate averages 64 rest frames
#define DRIFT_FRAMES_PER_COUNT 400  // 15 counts/min, the worst drift measured
#define DRIFT_LIMIT_BLIND      6000 // without pressure, 60 s of drift is all that may be forgiven
#define DRIFT_LIMIT            60000

_Static_assert(ROLL_BACK < BT_TARE_SNAPSHOTS, "the roll-back must be in the ring");

// ---- measures against the baseline ----------------------------------------------------------

// Values are below 2^28 and differences are rounded to 1/16 count, so that a square fits 32 bits.
static uint32_t square_q8(uint32_t value_q16, uint32_t base_q16)
{
    uint32_t q4 = (bt_abs32((int32_t)(value_q16 - base_q16)) + (1 << 11)) >> 12;
    return q4 * q4;
}

static uint32_t energy_of_medians(const bt_tare *tare)
{
    const uint16_t *median = bt_history_medians(&tare->history, 0);
    uint64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (median[i] != BT_INVALID_COUNT) {
            sum += square_q8((uint32_t)median[i] << 16, tare->base.electrode_q16[i]);
        }
    }
    return (uint32_t)(sum >> 8);
}

static uint32_t energy_of_means(const bt_tare *tare, const uint32_t mean_q16[BT_ELECTRODES])
{
    uint64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (bt_history_known(&tare->history, i)) {
            sum += square_q8(mean_q16[i], tare->base.electrode_q16[i]);
        }
    }
    return (uint32_t)(sum >> 8);
}

static bool pdc_known(const bt_tare *tare)
{
    return tare->history.pdc_now && tare->base.pdc_q16 != BT_TARE_UNKNOWN;
}

static int64_t pdc_above_rest_q16(const bt_tare *tare)
{
    return ((int64_t)bt_history_pdc_median(&tare->history) << 16) - tare->base.pdc_q16;
}

uint32_t bt_tare_threshold_count2(const bt_tare *tare, uint32_t setting_count2)
{
    uint32_t noise = tare->noise_count2 * 4;
    return noise > setting_count2 ? noise : setting_count2;
}

// ---- changes of the baseline ----------------------------------------------------------------

static void forget_contact(bt_tare *tare)
{
    tare->hits = 0;
    tare->calm_frames = 0;
    tare->still_frames = 0;
    tare->settle_frames = 0;
    tare->contact_frames = 0;
    tare->energy_peak = 0;
    tare->pdc_peak_q16 = 0;
}

static void adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason)
{
    tare->base = *base;
    tare->state = state;
    tare->reason = reason;
    tare->changed = true;
    tare->age_frames = 0;
    forget_contact(tare);
    tare->snapshot[0] = *base;
    tare->snapshot_head = 0;
    tare->snapshots = 1;
    tare->snapshot_countdown = SNAPSHOT_FRAMES;
}

static void adopt_present(bt_tare *tare, uint8_t reason)
{
    const bt_history *history = &tare->history;
    bt_baseline base;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool known = bt_history_known(history, i);
        base.electrode_q16[i] = known ? bt_history_settled_q16(history, i) : BT_TARE_UNKNOWN;
    }
    // The pressure of the last frames counts even when this very frame's word was bad.
    bool pdc = bt_history_pdc_median(history) != BT_INVALID_COUNT;
    base.pdc_q16 = pdc ? bt_history_pdc_mean_q16(history) : BT_TARE_UNKNOWN;
    adopt(tare, &base, BT_TARE_STATE_REST, reason);
}

// A channel whose first word comes only now begins at rest: against any other baseline it would
// look like a contact.
static void meet_new_channels(bt_tare *tare)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (tare->base.electrode_q16[i] == BT_TARE_UNKNOWN && bt_history_known(&tare->history, i)) {
            uint32_t first_q16 = (uint32_t)bt_history_medians(&tare->history, 0)[i] << 16;
            tare->base.electrode_q16[i] = first_q16;
            for (int k = 0; k < BT_TARE_SNAPSHOTS; k++) {
                tare->snapshot[k].electrode_q16[i] = first_q16;
            }
        }
    }
    if (tare->base.pdc_q16 == BT_TARE_UNKNOWN && tare->history.pdc_now && tare->state == BT_TARE_STATE_REST) {
        tare->base.pdc_q16 = bt_history_pdc_mean_q16(&tare->history);
        for (int k = 0; k < BT_TARE_SNAPSHOTS; k++) {
            tare->snapshot[k].pdc_q16 = tare->base.pdc_q16;
        }
    }
}

static uint32_t follow(uint32_t base_q16, uint32_t target_q16, int32_t step_q16)
{
    int32_t change_q16 = (int32_t)(target_q16 - base_q16);
    change_q16 = change_q16 > step_q16 ? step_q16 : change_q16 < -step_q16 ? -step_q16 : change_q16;
    return base_q16 + (uint32_t)change_q16;
}

static void track_drift(bt_tare *tare, const uint32_t mean_q16[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (bt_history_known(&tare->history, i)) {
            tare->base.electrode_q16[i] = follow(tare->base.electrode_q16[i], mean_q16[i], SLEW_Q16);
        }
    }
    if (pdc_known(tare)) {
        uint32_t pdc_q16 = (uint32_t)bt_history_pdc_median(&tare->history) << 16;
        tare->base.pdc_q16 = follow(tare->base.pdc_q16, pdc_q16, PDC_SLEW_Q16);
    }
    if (--tare->snapshot_countdown == 0) {
        tare->snapshot_countdown = SNAPSHOT_FRAMES;
        tare->snapshot_head = (uint8_t)((tare->snapshot_head + 1) % BT_TARE_SNAPSHOTS);
        tare->snapshot[tare->snapshot_head] = tare->base;
        if (tare->snapshots < BT_TARE_SNAPSHOTS) {
            tare->snapshots++;
        }
    }
}

_Static_assert(BT_SETTING_CONTACT_ENERGY_COUNT2_MAX <= INT32_MAX >> 8, "the noise in q8 must fit 31 bits");

// The sample is capped at the setting: a vibration that grows slowly must not raise the threshold
// ahead of itself for ever. The threshold so never exceeds four times the setting.
static void measure_noise(bt_tare *tare, uint32_t setting_count2)
{
    uint32_t sample = bt_history_noise(&tare->history);
    sample = sample < setting_count2 ? sample : setting_count2;
    if (tare->noise_frames < 1 << NOISE_SHIFT) { // plain mean first, so that it starts unbiased
        tare->noise_frames++;
    }
    int32_t change_q8 = (int32_t)((sample << 8) - tare->noise_q8);
    uint32_t step_q8 = bt_div_round_u32(bt_abs32(change_q8), tare->noise_frames);
    tare->noise_q8 += (uint32_t)bt_with_sign(step_q8, change_q8);
    if (tare->noise_frames == 1 << NOISE_SHIFT) {
        tare->noise_count2 = tare->noise_q8 >> 8;
    }
}

// ---- states ---------------------------------------------------------------------------------

static void update_init(bt_tare *tare)
{
    if (bt_history_still(&tare->history, STILL_SPAN)) {
        adopt_present(tare, BT_TARE_REASON_START);
    }
}

static void update_rest(bt_tare *tare, uint32_t setting_count2)
{
    uint32_t mean_q16[BT_ELECTRODES];
    bool hit = energy_of_medians(tare) > bt_tare_threshold_count2(tare, setting_count2)
               || (pdc_known(tare) && pdc_above_rest_q16(tare) > PDC_HIT_Q16);
    if (!hit) {
        tare->hits = 0;
        bt_history_means_q16(&tare->history, mean_q16);
        track_drift(tare, mean_q16);
        measure_noise(tare, setting_count2);
        return;
    }
    if (++tare->hits < HITS) {
        return;
    }
    int back = tare->snapshots > ROLL_BACK ? ROLL_BACK : tare->snapshots - 1;
    int at = (tare->snapshot_head + BT_TARE_SNAPSHOTS - back) % BT_TARE_SNAPSHOTS;
    bt_baseline before = tare->snapshot[at];
    adopt(tare, &before, BT_TARE_STATE_CONTACT, BT_TARE_REASON_ROLL_BACK);
}

// How long the signals have rested where they are. Means of eight keep noise out.
static uint8_t settled_for(bt_tare *tare, const uint32_t mean_q16[BT_ELECTRODES])
{
    uint16_t pdc = bt_history_pdc_median(&tare->history);
    int pdc_change = pdc - tare->settle_pdc;
    bool moved = pdc_change > SETTLE_PDC_SPAN || pdc_change < -SETTLE_PDC_SPAN;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        moved = moved || bt_abs32((int32_t)(mean_q16[i] - tare->settle_q16[i])) > SETTLE_SPAN_Q16;
    }
    if (!moved) {
        return tare->settle_frames < UINT8_MAX ? ++tare->settle_frames : UINT8_MAX;
    }
    memcpy(tare->settle_q16, mean_q16, sizeof tare->settle_q16);
    tare->settle_pdc = pdc;
    tare->settle_frames = 0;
    return 0;
}

// On real fingers the skin's hysteresis leaves thousands of count^2 and some pressure after a press,
// so that neither energy nor pressure come back to the tare. What tells a release then is that the
// pressure has fallen far below the press's own peak and nothing moves any more. A load that only
// grows is at its peak all the time and never passes.
static bool released_by_pressure(bt_tare *tare, const uint32_t mean_q16[BT_ELECTRODES])
{
    int64_t pdc_q16 = pdc_above_rest_q16(tare);
    if (pdc_q16 > tare->pdc_peak_q16) {
        tare->pdc_peak_q16 = (int32_t)pdc_q16;
    }
    // Without a press there is no release: a light touch while the pressure undershoots has no peak.
    bool pressed = tare->pdc_peak_q16 >= RELEASE_FALL * PDC_HIT_Q16;
    bool fallen = pdc_q16 < SETTLE_PDC_Q16 && pdc_q16 * RELEASE_FALL < tare->pdc_peak_q16;
    return settled_for(tare, mean_q16) >= SETTLE_FRAMES && pressed && fallen;
}

_Static_assert((uint64_t)DRIFT_LIMIT *DRIFT_LIMIT <= UINT32_MAX, "the forgiven drift must fit 32 bits");

static uint32_t residue_limit(const bt_tare *tare)
{
    uint32_t limit = pdc_known(tare) ? DRIFT_LIMIT : DRIFT_LIMIT_BLIND;
    uint32_t frames = tare->contact_frames < limit ? tare->contact_frames : limit;
    uint32_t drift_count2 = BT_DIVIDE_U32(frames * frames, DRIFT_FRAMES_PER_COUNT * DRIFT_FRAMES_PER_COUNT);
    return RESIDUE_ENERGY + BT_ELECTRODES * drift_count2;
}

static void update_contact(bt_tare *tare)
{
    tare->contact_frames++;
    uint32_t mean_q16[BT_ELECTRODES];
    bt_history_means_q16(&tare->history, mean_q16);
    uint32_t energy = energy_of_means(tare, mean_q16);
    tare->energy_peak = energy > tare->energy_peak ? energy : tare->energy_peak;
    bool pressure = pdc_known(tare);
    // Without pressure the energy itself must have fallen, or the first second of a slow load would
    // pass for a residue.
    bool quiet =
        pressure ? pdc_above_rest_q16(tare) < PDC_QUIET_Q16 : energy < tare->energy_peak / RELEASE_FALL;
    bool calm = energy < CALM_ENERGY && (quiet || !pressure);
    bool still = quiet && energy < residue_limit(tare) && bt_history_motion(&tare->history) < RESIDUE_MOTION;
    tare->calm_frames = calm ? (uint8_t)(tare->calm_frames + 1) : 0;
    tare->still_frames = still ? (uint8_t)(tare->still_frames + 1) : 0;
    bool settled = pressure && released_by_pressure(tare, mean_q16);
    if (tare->calm_frames >= CALM_FRAMES) {
        adopt_present(tare, BT_TARE_REASON_RELEASE);
    } else if (tare->still_frames >= RESIDUE_FRAMES || settled) {
        adopt_present(tare, BT_TARE_REASON_RESIDUE);
    }
}

void bt_tare_reset(bt_tare *tare)
{
    memset(tare, 0, sizeof *tare);
    bt_history_reset(&tare->history);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        tare->base.electrode_q16[i] = BT_TARE_UNKNOWN;
    }
    tare->base.pdc_q16 = BT_TARE_UNKNOWN;
}

void bt_tare_update(bt_tare *tare, const bt_frame *frame, uint32_t threshold_count2)
{
    tare->changed = false;
    tare->age_frames++;
    if (bt_frame_unusable(frame) > BT_USABLE_WITHOUT) {
        // Nothing of a faulty frame may reach a tare: the history starts over when it clears.
        tare->state = BT_TARE_STATE_FAULT;
        bt_history_restart(&tare->history);
        return;
    }
    bt_history_add(&tare->history, frame);
    if (tare->state == BT_TARE_STATE_FAULT) {
        // A tare from before the fault still holds, but what touched meanwhile is unknown:
        // CONTACT freezes it until the release rules have seen quiet signals.
        tare->state = tare->reason == BT_TARE_REASON_NONE ? BT_TARE_STATE_INIT : BT_TARE_STATE_CONTACT;
        tare->calm_frames = 0;
        tare->still_frames = 0;
        tare->settle_frames = 0;
    }
    if (tare->state == BT_TARE_STATE_INIT) {
        update_init(tare);
        return;
    }
    meet_new_channels(tare);
    if (tare->state == BT_TARE_STATE_REST) {
        update_rest(tare, threshold_count2);
    } else {
        update_contact(tare);
    }
}

uint8_t bt_tare_now(bt_tare *tare)
{
    if (tare->state == BT_TARE_STATE_FAULT) {
        return BT_ERROR_RAILED;
    }
    if (!bt_history_still(&tare->history, STILL_SPAN)) {
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
