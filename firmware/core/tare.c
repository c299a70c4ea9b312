#include "tare.h"

#include "fix.h"

#include <string.h>

// Frame counts and bounds of the machine (numerics 1.4). 100 frames are one second.
#define WINDOW          8         // frames averaged into a new tare
#define STILL_SPAN      32        // counts an electrode may move within the window: six noise sigmas
#define HITS            3         // frames over the threshold that make a contact
#define PDC_HIT_Q16     (6 << 16) // pressure above rest that is a contact
#define PDC_QUIET_Q16   (4 << 16) // pressure above rest that still is a release; one-sided, it undershoots
#define SLEW_Q16        328       // 0.5 count/s: drift is followed no faster, so a load is not
#define PDC_SLEW_Q16    131       // 0.2 count/s
#define SNAPSHOT_FRAMES 25
#define ROLL_BACK       4   // snapshots: at least one second before the contact was seen
#define CALM_ENERGY     400 // count^2 around the tare
#define CALM_FRAMES     10
#define RESIDUE_ENERGY  6000 // count^2 that skin hysteresis may leave
#define RESIDUE_MOTION  800  // count^2 between two means of five, five frames apart
#define RESIDUE_FRAMES  100
#define SETTLE_SPAN_Q16 (12 << 16) // counts; settled signals stay this close to where they came to rest
#define SETTLE_PDC_SPAN 4
#define SETTLE_FRAMES   40
#define SETTLE_PDC_Q16  (30 << 16)  // pressure that real skin keeps after a press (+24 seen), not more
#define SETTLE_FALL     4           // and only once it has fallen to a quarter of the press's peak
#define NOISE_SHIFT     6           // the noise estimate averages 64 rest frames
#define NOISE_LAG       3           // medians of three share no sample at this distance
#define FAULT_RAILED    2           // more electrodes than this railed or missing is a fault
#define DRIFT_FRAMES_PER_COUNT 400  // 15 counts/min, the worst drift measured
#define DRIFT_LIMIT_BLIND      6000 // without pressure, 60 s of drift is all that may be forgiven
#define DRIFT_LIMIT            60000

_Static_assert(WINDOW + 2 <= BT_TARE_HISTORY, "the window needs medians of three");
_Static_assert(ROLL_BACK < BT_TARE_SNAPSHOTS, "the roll-back must be in the ring");

bool bt_count_railed(uint16_t count)
{
    return count == 0 || (count >= 4090 && count != BT_INVALID_COUNT);
}

uint16_t bt_tare_q4(uint32_t base_q16)
{
    return (uint16_t)bt_div_round(base_q16, 1 << 12);
}

// ---- history --------------------------------------------------------------------------------

static const uint16_t *counts_ago(const bt_tare *tare, int frames)
{
    return tare->counts[(tare->head + BT_TARE_HISTORY - frames) % BT_TARE_HISTORY];
}

static uint16_t pdc_ago(const bt_tare *tare, int frames)
{
    return tare->pdc[(tare->head + BT_TARE_HISTORY - frames) % BT_TARE_HISTORY];
}

static uint16_t median3(uint16_t a, uint16_t b, uint16_t c)
{
    uint16_t low = a < b ? a : b;
    uint16_t high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

// Median of three consecutive counts ending `frames` ago: single-sample glitches are as frequent
// as one frame in ten and alone exceed the contact threshold.
static uint16_t median_ago(const bt_tare *tare, int electrode, int frames)
{
    int middle = frames + 1 < tare->filled ? frames + 1 : frames;
    int oldest = frames + 2 < tare->filled ? frames + 2 : middle;
    return median3(counts_ago(tare, frames)[electrode], counts_ago(tare, middle)[electrode],
                   counts_ago(tare, oldest)[electrode]);
}

static uint32_t mean_q16(const bt_tare *tare, int electrode, int frames)
{
    uint32_t sum = 0;
    for (int k = 0; k < frames; k++) {
        sum += counts_ago(tare, k)[electrode];
    }
    return (uint32_t)bt_div_round((int64_t)sum << 16, frames);
}

static uint32_t pdc_mean_q16(const bt_tare *tare, int frames)
{
    uint32_t sum = 0;
    for (int k = 0; k < frames; k++) {
        sum += pdc_ago(tare, k);
    }
    return (uint32_t)bt_div_round((int64_t)sum << 16, frames);
}

static void remember(bt_tare *tare, const bt_frame *frame)
{
    const uint16_t *before = counts_ago(tare, 0);
    uint16_t pdc_before = pdc_ago(tare, 0);
    uint8_t next = (uint8_t)((tare->head + 1) % BT_TARE_HISTORY);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t count = frame->electrode[i];
        tare->counts[next][i] = count == BT_INVALID_COUNT ? before[i] : count;
    }
    // A pressure at the end of its range says nothing about contact.
    tare->pdc_now = frame->pdc != BT_INVALID_COUNT && !bt_count_railed(frame->pdc);
    tare->pdc[next] = tare->pdc_now ? frame->pdc : pdc_before;
    if (tare->pdc_now && pdc_before == 0) { // the first pressure ever: no mean may reach before it
        for (int k = 0; k < BT_TARE_HISTORY; k++) {
            tare->pdc[k] = frame->pdc;
        }
    }
    tare->head = next;
    if (tare->filled < BT_TARE_HISTORY) {
        tare->filled++;
    }
}

// ---- measures -------------------------------------------------------------------------------

static int64_t square_q16(int64_t difference_q16)
{
    int64_t q4 = bt_div_round(difference_q16, 1 << 12);
    return q4 * q4; // count^2 in q8
}

static uint32_t energy_of_medians(const bt_tare *tare)
{
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int64_t count_q16 = (int64_t)median_ago(tare, i, 0) << 16;
        sum += square_q16(count_q16 - tare->base.electrode_q16[i]);
    }
    return (uint32_t)(sum >> 8);
}

static uint32_t energy_of_mean(const bt_tare *tare)
{
    int window = tare->filled < WINDOW ? tare->filled : WINDOW;
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += square_q16((int64_t)mean_q16(tare, i, window) - tare->base.electrode_q16[i]);
    }
    return (uint32_t)(sum >> 8);
}

// Energy of the change between the mean of the last five frames and that of the five before.
static uint32_t motion(const bt_tare *tare)
{
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t change = 0;
        for (int k = 0; k < 5; k++) {
            change += counts_ago(tare, k)[i] - counts_ago(tare, k + 5)[i];
        }
        sum += (int64_t)change * change;
    }
    return (uint32_t)bt_div_round(sum, 5 * 5);
}

static bool window_is_still(const bt_tare *tare)
{
    if (tare->filled < WINDOW + 2) {
        return false;
    }
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t low = UINT16_MAX;
        uint16_t high = 0;
        for (int k = 0; k < WINDOW; k++) {
            uint16_t m = median_ago(tare, i, k);
            low = m < low ? m : low;
            high = m > high ? m : high;
        }
        if (high - low > STILL_SPAN) {
            return false;
        }
    }
    return true;
}

static bool pdc_known(const bt_tare *tare)
{
    return tare->pdc_now && tare->base.pdc_q16 != BT_PDC_UNKNOWN;
}

static uint16_t pdc_median(const bt_tare *tare)
{
    int middle = tare->filled > 1 ? 1 : 0;
    int oldest = tare->filled > 2 ? 2 : middle;
    return median3(pdc_ago(tare, 0), pdc_ago(tare, middle), pdc_ago(tare, oldest));
}

static int64_t pdc_above_rest_q16(const bt_tare *tare)
{
    return ((int64_t)pdc_median(tare) << 16) - tare->base.pdc_q16;
}

static int unusable_electrodes(const bt_frame *frame)
{
    int n = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        n += frame->electrode[i] == BT_INVALID_COUNT || bt_count_railed(frame->electrode[i]);
    }
    return n;
}

uint32_t bt_tare_threshold_count2(const bt_tare *tare, uint32_t setting_count2)
{
    uint32_t noise = tare->noise_count2 * 4;
    return noise > setting_count2 ? noise : setting_count2;
}

// ---- transitions ----------------------------------------------------------------------------

static void adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason)
{
    tare->base = *base;
    tare->state = state;
    tare->reason = reason;
    tare->changed = true;
    tare->age_frames = 0;
    tare->hits = 0;
    tare->calm_frames = 0;
    tare->still_frames = 0;
    tare->contact_frames = 0;
    tare->settle_frames = 0;
    tare->pdc_peak_q16 = 0;
    tare->snapshot[0] = *base;
    tare->snapshot_head = 0;
    tare->snapshots = 1;
    tare->snapshot_countdown = SNAPSHOT_FRAMES;
}

static void adopt_mean(bt_tare *tare, uint8_t reason)
{
    bt_baseline base;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = mean_q16(tare, i, WINDOW);
    }
    base.pdc_q16 = tare->pdc_now ? pdc_mean_q16(tare, WINDOW) : BT_PDC_UNKNOWN;
    adopt(tare, &base, BT_TARE_STATE_REST, reason);
}

static uint32_t follow(uint32_t base_q16, uint32_t target_q16, int64_t step_q16)
{
    return (uint32_t)((int64_t)base_q16 + bt_clamp((int64_t)target_q16 - base_q16, -step_q16, step_q16));
}

static void track_drift(bt_tare *tare)
{
    int window = tare->filled < WINDOW ? tare->filled : WINDOW;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        tare->base.electrode_q16[i] =
            follow(tare->base.electrode_q16[i], mean_q16(tare, i, window), SLEW_Q16);
    }
    if (pdc_known(tare)) {
        uint32_t target = (uint32_t)(pdc_above_rest_q16(tare) + tare->base.pdc_q16);
        tare->base.pdc_q16 = follow(tare->base.pdc_q16, target, PDC_SLEW_Q16);
    } else if (tare->pdc_now) {
        tare->base.pdc_q16 = pdc_mean_q16(tare, window);
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

// Half the energy of the change over three frames is the noise energy, and stays so while a slow
// load builds up; the energy itself would raise the threshold along with the load.
static void measure_noise(bt_tare *tare)
{
    if (tare->filled < NOISE_LAG + 3) {
        return;
    }
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t change = median_ago(tare, i, 0) - median_ago(tare, i, NOISE_LAG);
        sum += change * change;
    }
    int64_t sample_q8 = sum << 7;
    if (tare->noise_frames < 1 << NOISE_SHIFT) { // plain mean first, so that it starts unbiased
        tare->noise_frames++;
        tare->noise_q8 = (uint64_t)((int64_t)tare->noise_q8
                                    + bt_div_round(sample_q8 - (int64_t)tare->noise_q8, tare->noise_frames));
    } else {
        tare->noise_q8 = (uint64_t)((int64_t)tare->noise_q8
                                    + bt_div_round(sample_q8 - (int64_t)tare->noise_q8, 1 << NOISE_SHIFT));
    }
    if (tare->noise_frames == 1 << NOISE_SHIFT) {
        tare->noise_count2 = (uint32_t)(tare->noise_q8 >> 8);
    }
}

static void update_init(bt_tare *tare)
{
    if (window_is_still(tare)) {
        adopt_mean(tare, BT_TARE_REASON_START);
    }
}

static void update_rest(bt_tare *tare, uint32_t setting_count2)
{
    bool hit = energy_of_medians(tare) > bt_tare_threshold_count2(tare, setting_count2)
               || (pdc_known(tare) && pdc_above_rest_q16(tare) > PDC_HIT_Q16);
    if (!hit) {
        tare->hits = 0;
        track_drift(tare);
        measure_noise(tare);
        return;
    }
    if (++tare->hits < HITS) {
        return;
    }
    int back = tare->snapshots > ROLL_BACK ? ROLL_BACK : tare->snapshots - 1;
    bt_baseline before = tare->snapshot[(tare->snapshot_head + BT_TARE_SNAPSHOTS - back) % BT_TARE_SNAPSHOTS];
    adopt(tare, &before, BT_TARE_STATE_CONTACT, BT_TARE_REASON_ROLL_BACK);
}

// How long the signals have rested where they are. Means of eight keep noise out.
static uint8_t settled_for(bt_tare *tare)
{
    int window = tare->filled < WINDOW ? tare->filled : WINDOW;
    int pdc_change = pdc_median(tare) - tare->settle_pdc;
    bool moved = pdc_change > SETTLE_PDC_SPAN || pdc_change < -SETTLE_PDC_SPAN;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int64_t change_q16 = (int64_t)mean_q16(tare, i, window) - tare->settle_q16[i];
        moved = moved || bt_abs(change_q16) > SETTLE_SPAN_Q16;
    }
    if (!moved) {
        return tare->settle_frames < UINT8_MAX ? ++tare->settle_frames : UINT8_MAX;
    }
    for (int i = 0; i < BT_ELECTRODES; i++) {
        tare->settle_q16[i] = mean_q16(tare, i, window);
    }
    tare->settle_pdc = pdc_median(tare);
    tare->settle_frames = 0;
    return 0;
}

// On real fingers the skin's hysteresis leaves thousands of count^2 and some pressure after a press,
// so that neither energy nor pressure come back to the tare. What tells a release then is that the
// pressure has fallen far below the press's own peak and nothing moves any more. A load that only
// grows is at its peak all the time and never passes.
static bool released_with_residue(bt_tare *tare)
{
    if (!pdc_known(tare)) {
        return false;
    }
    int64_t pdc_q16 = pdc_above_rest_q16(tare);
    if (pdc_q16 > tare->pdc_peak_q16) {
        tare->pdc_peak_q16 = (int32_t)pdc_q16;
    }
    bool fallen = pdc_q16 < SETTLE_PDC_Q16 && pdc_q16 * SETTLE_FALL < tare->pdc_peak_q16;
    return settled_for(tare) >= SETTLE_FRAMES && fallen;
}

static uint64_t residue_limit(const bt_tare *tare)
{
    uint64_t limit = pdc_known(tare) ? DRIFT_LIMIT : DRIFT_LIMIT_BLIND;
    uint64_t frames = tare->contact_frames < limit ? tare->contact_frames : limit;
    return RESIDUE_ENERGY
           + BT_ELECTRODES * frames * frames / ((uint64_t)DRIFT_FRAMES_PER_COUNT * DRIFT_FRAMES_PER_COUNT);
}

static void update_contact(bt_tare *tare)
{
    tare->contact_frames++;
    bool quiet = !pdc_known(tare) || pdc_above_rest_q16(tare) < PDC_QUIET_Q16;
    uint32_t energy = energy_of_mean(tare);
    bool calm = quiet && energy < CALM_ENERGY;
    bool still = quiet && energy < residue_limit(tare) && motion(tare) < RESIDUE_MOTION;
    tare->calm_frames = calm ? (uint8_t)(tare->calm_frames + 1) : 0;
    tare->still_frames = still ? (uint8_t)(tare->still_frames + 1) : 0;
    bool settled = released_with_residue(tare);
    if (tare->calm_frames >= CALM_FRAMES) {
        adopt_mean(tare, BT_TARE_REASON_RELEASE);
    } else if (tare->still_frames >= RESIDUE_FRAMES || settled) {
        adopt_mean(tare, BT_TARE_REASON_RESIDUE);
    }
}

void bt_tare_reset(bt_tare *tare)
{
    memset(tare, 0, sizeof *tare);
    tare->base.pdc_q16 = BT_PDC_UNKNOWN;
}

void bt_tare_update(bt_tare *tare, const bt_frame *frame, uint32_t threshold_count2)
{
    bool faulty = unusable_electrodes(frame) > FAULT_RAILED;
    tare->changed = false;
    tare->age_frames++;
    if (faulty) {
        // Nothing of a faulty frame may reach a tare: the history starts over when it clears.
        tare->state = BT_TARE_STATE_FAULT;
        tare->filled = 0;
        return;
    }
    remember(tare, frame);
    if (tare->state == BT_TARE_STATE_FAULT) {
        // A tare from before the fault still holds, but what touched meanwhile is unknown:
        // CONTACT freezes it until the release rules have seen quiet signals.
        tare->state = tare->reason == BT_TARE_REASON_NONE ? BT_TARE_STATE_INIT : BT_TARE_STATE_CONTACT;
        tare->calm_frames = 0;
        tare->still_frames = 0;
    }
    switch (tare->state) {
    case BT_TARE_STATE_INIT:
        update_init(tare);
        break;
    case BT_TARE_STATE_REST:
        update_rest(tare, threshold_count2);
        break;
    default:
        update_contact(tare);
        break;
    }
}

uint8_t bt_tare_now(bt_tare *tare)
{
    if (tare->state == BT_TARE_STATE_FAULT) {
        return BT_ERROR_RAILED;
    }
    if (!window_is_still(tare)) {
        return BT_ERROR_NOT_STILL;
    }
    adopt_mean(tare, BT_TARE_REASON_HOST_NOW);
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
