#include "events/events.h"

#include "fixed_point.h"

#include <string.h>

// Unit: squared change of a four-sample sum. Worst public noise (5 counts) gives 200.
#define LEVEL_MIN_COUNT2      800
#define BEGIN_MIN_COUNT2      1200 // until a slip is on: squeezes of 2 N/s shake by more than 800
#define RATTLE_LEVELS         7    // white noise changes by four times the difference of neighbouring samples
#define RATTLE_PAIRS_LOG2     5    // pairs that the rattle is averaged over: 30 ms
// Unit: levels; chosen on 100 real slides, 344 handovers, a real press, and simulated squeezes, slips and
// noise.
#define CHANGE_CAP_LEVELS     12 // per change: a glitch, which is four changes, must be no event
#define JOLT_LEVELS           22
#define SLIP_LEVELS           17 // on each side
#define SIDE_CAP_LEVELS       28
#define SLIP_CAP_LEVELS       100 // a slip ends once nothing has shaken for some 0.1 s
#define TOLL_LEVELS_Q4        11  // lost by each side per change
// Limits of a unit and of a round's noise at rest: a glitch as large as the range, and sigma 109.
#define UNIT_MAX_COUNT2       (1u << 22)
#define NOISE_MAX_COUNT2      (1u << 20)
// Unit: samples, except NOISE_ROUNDS_LOG2
#define VIBRATION_MAX_SAMPLES 18  // between rise and fall; 8 ms
#define LANDING_MIN_SAMPLES   220 // 0.1 s
#define LANDING_MAX_SAMPLES   2200
#define NOISE_ROUNDS_LOG2     6       // rounds that the noise is averaged over
#define MISSING               0x4000u // in place of a pair's sum; sums of four that hold it are at least that

#define EVENT(event) (1u << (event))

_Static_assert((uint64_t)NOISE_MAX_COUNT2 * 1490 <= UINT32_MAX,
               "the noise of a round, as a level, must fit its type");
_Static_assert((uint64_t)UNIT_MAX_COUNT2 *(SLIP_CAP_LEVELS + CHANGE_CAP_LEVELS * BT_EVENTS_PAIRS)
                       <= UINT32_MAX
                   && (uint64_t)UNIT_MAX_COUNT2 * TOLL_LEVELS_Q4 <= UINT32_MAX,
               "evidence must fit its type");
_Static_assert((uint64_t)BT_EVENTS_PAIRS * 16 * BT_FULL_SCALE_COUNT * BT_FULL_SCALE_COUNT <= UINT32_MAX,
               "a round's squared changes must fit their type");
_Static_assert(RATTLE_LEVELS *((uint64_t)BT_FULL_SCALE_COUNT *BT_FULL_SCALE_COUNT >> RATTLE_PAIRS_LOG2)
                   <= UNIT_MAX_COUNT2,
               "the largest glitch must raise its own unit");
_Static_assert(4 * BT_FULL_SCALE_COUNT < MISSING && 2 * MISSING <= UINT16_MAX, "a sum must not look missing");
_Static_assert((uint64_t)BT_ELECTRODES * BT_TRIGGER_UNREAD * BT_TRIGGER_UNREAD <= UINT32_MAX,
               "energy must fit its type");
_Static_assert(4 * (1 << RATTLE_PAIRS_LOG2) < JOLT_LEVELS * RATTLE_LEVELS
                   && 2 * (1 << RATTLE_PAIRS_LOG2) < SLIP_LEVELS * RATTLE_LEVELS,
               "one glitch must not be an event");
_Static_assert(BT_EVENTS_PAIRS == 11,
               "1490/8192 is 2/11, and 5/64 of a root is that of a mean change of one sample");

static BT_NOINLINE void forget_pairs(bt_events *events)
{
    events->pair = MISSING;
    for (int k = 0; k < BT_EVENTS_APART; k++) {
        events->four[k] = MISSING;
    }
}

void bt_events_reset(bt_events *events)
{
    memset(events, 0, sizeof *events);
    events->strongest_slot = BT_EVENTS_NO_SLOT;
    events->level_count2 = LEVEL_MIN_COUNT2;
    events->noise_count2 = LEVEL_MIN_COUNT2 / 2 * BT_EVENTS_PAIRS;
    events->slip_level = BT_SLIP_LEVEL_NONE;
    forget_pairs(events);
}

// ---- touch and release

static uint32_t electrode_energy(const bt_tare *tare, unsigned electrode)
{
    int32_t e = tare->trigger.smooth.lane[electrode] - tare->trigger.rest.lane[electrode];
    return (uint32_t)(e * e);
}

// Add up the energy, and select the slot of the strongest electrode.
static BT_NOINLINE void weigh(bt_events *events, const bt_tare *tare)
{
    uint32_t strongest = 0;
    events->energy_count2 = 0;
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        unsigned electrode = (unsigned)bt_slot_channel[slot] - BT_CHANNEL_E1;
        if (electrode < BT_ELECTRODES) {
            uint32_t square = electrode_energy(tare, electrode);
            events->energy_count2 += square;
            if (square >= strongest) {
                strongest = square;
                events->strongest_slot = slot;
            }
        }
    }
}

static uint32_t begin_touch(bt_events *events)
{
    events->touched = true;
    events->landing = true;
    events->touch_began = events->now;
    return EVENT(BT_EVENT_KIND_TOUCH);
}

uint32_t bt_events_touch(bt_events *events, const bt_tare *tare)
{
    if (events->touched) {
        return 0;
    }
    weigh(events, tare);
    return begin_touch(events);
}

static bool pressed(const bt_tare *tare)
{
    int32_t rest = tare->trigger.rest.lane[BT_LANE_PDC];
    return rest != 0 && tare->trigger.smooth.lane[BT_LANE_PDC] - rest > BT_PDC_HIT;
}

uint32_t bt_events_lift(bt_events *events, const bt_tare *tare)
{
    const uint32_t half = tare->threshold_count2 / 2;
    if (electrode_energy(tare, (unsigned)bt_slot_channel[events->strongest_slot] - BT_CHANNEL_E1) > half) {
        return 0;
    }
    weigh(events, tare);
    if (events->energy_count2 > half || pressed(tare)) {
        return 0;
    }
    events->touched = false;
    events->strongest_slot = BT_EVENTS_NO_SLOT;
    return EVENT(BT_EVENT_KIND_LIFT);
}

// A tare machine that stays in contact after a LIFT expects no new touch from the trigger.
static BT_NOINLINE uint32_t touched_again(bt_events *events, const bt_tare *tare)
{
    weigh(events, tare);
    if (events->energy_count2 > tare->threshold_count2) {
        return begin_touch(events);
    }
    events->strongest_slot = BT_EVENTS_NO_SLOT;
    return 0;
}

// ---- dynamic pressure

// One copy for both callers: RAM, which the code runs from, is short.
static BT_NOINLINE uint32_t square_root(uint32_t square)
{
    return bt_root_u32(square);
}

// L of SPEC.md. Thresholds of one change are fractions of it.
static BT_NOINLINE uint32_t evidence_unit(const bt_events *events)
{
    const uint32_t rattle = RATTLE_LEVELS * events->rattle_count2;
    const uint32_t unit = rattle > events->level_count2 ? rattle : events->level_count2;
    return unit > UNIT_MAX_COUNT2 ? UNIT_MAX_COUNT2 : unit;
}

static uint8_t slip_level(const bt_events *events)
{
    const uint32_t explained = BT_EVENTS_PAIRS * evidence_unit(events);
    if (!events->slipping || events->shaken_count2 <= explained) {
        return 0;
    }
    const uint32_t counts = square_root(events->shaken_count2 - explained) * 5 >> 6;
    return counts < BT_SLIP_LEVEL_NONE ? (uint8_t)counts : BT_SLIP_LEVEL_NONE - 1;
}

static void end_round(bt_events *events, const bt_tare *tare)
{
    if (!events->touched && tare->state == BT_TARE_STATE_REST) {
        const uint32_t seen =
            events->round_count2 < NOISE_MAX_COUNT2 ? events->round_count2 : NOISE_MAX_COUNT2;
        events->noise_count2 +=
            (uint32_t)bt_shift_down((int32_t)(seen - events->noise_count2), NOISE_ROUNDS_LOG2);
        const uint32_t level = events->noise_count2 * 1490 >> 13;
        events->level_count2 = level < LEVEL_MIN_COUNT2 ? LEVEL_MIN_COUNT2 : level;
    }
    events->slip_level = events->pac_valid ? slip_level(events) : BT_SLIP_LEVEL_NONE;
    events->pac_valid = false;
    events->round_count2 = events->shaken_count2 = 0;
    events->pairs_done = 0;
}

// Add up pairs of samples, and average the squared difference within a pair.
static inline void follow(bt_events *events, const uint16_t *pac, unsigned pairs)
{
    uint32_t differ_count2 = 0, missing = 0, before = events->pair;
    uint16_t *four = events->four + BT_EVENTS_APART;
    for (const uint16_t *end = pac + 2 * pairs; pac < end; pac += 2) {
        const uint32_t first = pac[0], second = pac[1];
        uint32_t pair = MISSING;
        if ((first | second) <= BT_FULL_SCALE_COUNT) {
            pair = first + second;
            differ_count2 += (first - second) * (first - second);
        } else {
            missing++;
        }
        *four++ = (uint16_t)(before + pair);
        before = pair;
    }
    events->pair = (uint16_t)before;
    events->pac_valid |= missing < pairs;
    const int32_t more = (int32_t)(differ_count2 - (pairs - missing) * events->rattle_count2);
    events->rattle_count2 += (uint32_t)bt_shift_down(more, RATTLE_PAIRS_LOG2);
}

// Change of a sum of four samples over eight samples; 0 where any word is missing.
static inline int32_t pac_change(const uint16_t *then)
{
    const uint32_t now = then[BT_EVENTS_APART], before = then[0];
    return (now | before) >= MISSING ? 0 : (int32_t)(now - before);
}

static inline uint32_t squared(const bt_events *events, unsigned pairs)
{
    uint32_t all = 0;
    for (const uint16_t *then = events->four, *end = then + pairs; then < end; then++) {
        const int32_t change = pac_change(then);
        all += (uint32_t)(change * change);
    }
    return all;
}

typedef struct {
    uint32_t full, all, rose, peak; // squares added: in full, capped, of rises; the largest
} changes;

static inline void add_up(const bt_events *events, unsigned pairs, uint32_t cap, changes *sums)
{
    uint32_t full = 0, all = 0, rose = 0, peak = 0;
    for (const uint16_t *then = events->four, *end = then + pairs; then < end; then++) {
        const int32_t change = pac_change(then);
        uint32_t square = (uint32_t)(change * change);
        full += square;
        peak = square > peak ? square : peak;
        square = square > cap ? cap : square;
        all += square;
        rose += change > 0 ? square : 0;
    }
    *sums = (changes){full, all, rose, peak};
}

static BT_NOINLINE uint32_t deduct(uint32_t evidence, uint32_t toll, uint32_t most)
{
    const uint32_t left = evidence > toll ? evidence - toll : 0;
    return left > most ? most : left;
}

// First sample of the first pair that rises, or falls, by more than noise.
static BT_NOINLINE uint32_t first_change(const bt_events *events, uint32_t toll, bool falls)
{
    unsigned k = 0;
    for (;; k++) {
        const int32_t change = pac_change(events->four + k);
        if ((falls ? change < 0 : change > 0) && (uint32_t)(change * change) > toll) {
            return events->now + 2 * k;
        }
    }
}

static inline bool shakes(const bt_events *events)
{
    return (events->risen_count2 | events->fallen_count2) != 0;
}

// Add changes to the evidence, and subtract the toll once for all of them.
static void add_evidence(bt_events *events, unsigned pairs, uint32_t unit, uint32_t rose, uint32_t fell)
{
    const uint32_t cost = unit * TOLL_LEVELS_Q4 >> 4, toll = cost * pairs, most = SIDE_CAP_LEVELS * unit;
    const uint32_t rises = deduct(events->risen_count2 + rose, toll, most);
    const uint32_t falls = deduct(events->fallen_count2 + fell, toll, most);
    if (events->risen_count2 == 0 && rises != 0) {
        events->rise_began = first_change(events, cost, false);
    }
    if (events->fallen_count2 == 0 && falls != 0) {
        events->fall_began = first_change(events, cost, true);
    }
    if (!shakes(events)) {
        const bool falls_first = (int32_t)(events->fall_began - events->rise_began) < 0;
        events->shake_began =
            falls != 0 && (falls_first || rises == 0) ? events->fall_began : events->rise_began;
    }
    events->risen_count2 = rises;
    events->fallen_count2 = falls;
}

// True while no other event may begin: in a slip, and after a jolt while untouched or landing.
static inline bool event_is_on(const bt_events *events)
{
    return events->slipping || (events->jolt_raised && (events->landing || !events->touched));
}

static BT_NOINLINE void shake(bt_events *events, unsigned pairs, uint32_t unit)
{
    changes sums;
    add_up(events, pairs, CHANGE_CAP_LEVELS * unit, &sums);
    events->shaken_count2 += sums.full;
    events->round_count2 += sums.all;
    if (!shakes(events) || sums.peak > events->peak_count2) {
        events->peak_count2 = sums.peak;
    }
    if (event_is_on(events)) { // only the duration matters now: both sides count as one
        const uint32_t sum = events->risen_count2 + events->fallen_count2 + sums.all;
        events->risen_count2 = deduct(sum, pairs * unit, SLIP_CAP_LEVELS * unit);
        events->fallen_count2 = 0;
    } else {
        add_evidence(events, pairs, unit, sums.rose, sums.all - sums.rose);
    }
}

// Evidence stays 0 while all changes together are mere noise, as most of the time.
static inline void look(bt_events *events, unsigned pairs, uint32_t unit)
{
    const uint32_t all = shakes(events) ? UINT32_MAX : squared(events, pairs);
    if (all > pairs * (unit * TOLL_LEVELS_Q4 >> 4)) {
        shake(events, pairs, unit);
    } else {
        events->shaken_count2 += all;
        events->round_count2 += all;
    }
}

static uint32_t end_slip(bt_events *events)
{
    uint32_t raised = events->slipping ? EVENT(BT_EVENT_KIND_STUCK) : 0;
    events->slipping = false;
    return raised;
}

static uint32_t end_shaking(bt_events *events)
{
    events->jolt_raised = false;
    events->landing = events->landing && events->now - events->touch_began < LANDING_MIN_SAMPLES;
    return end_slip(events);
}

// True when rises and falls each have enough evidence. One vibration slips from the earlier of the two, two
// vibrations from the later.
static bool begins_to_slip(bt_events *events, uint32_t unit)
{
    const uint32_t each = SLIP_LEVELS * unit;
    const int32_t apart = (int32_t)(events->fall_began - events->rise_began);
    const bool joined = apart <= VIBRATION_MAX_SAMPLES && apart >= -VIBRATION_MAX_SAMPLES;
    events->slip_began = (apart > 0) == joined ? events->rise_began : events->fall_began;
    return events->risen_count2 > each && events->fallen_count2 > each;
}

static inline uint32_t raise_events(bt_events *events, uint32_t level, uint32_t unit)
{
    uint32_t raised = 0;
    if (!shakes(events)) {
        return end_shaking(events);
    }
    if (!events->jolt_raised && events->risen_count2 + events->fallen_count2 > JOLT_LEVELS * level) {
        events->jolt_raised = true;
        raised = EVENT(BT_EVENT_KIND_JOLT);
    }
    if (!events->touched) {
        return raised | end_slip(events);
    }
    events->landing = events->landing && events->now - events->touch_began < LANDING_MAX_SAMPLES;
    if (!events->slipping && !events->landing && begins_to_slip(events, unit)) {
        events->slipping = true;
        raised |= EVENT(BT_EVENT_KIND_SLIP);
    }
    return raised;
}

uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end)
{
    const unsigned ended = end / 2, begun = events->pairs_done < ended ? events->pairs_done : 0;
    if (begun != events->pairs_done || ended - begun > BT_EVENTS_APART) { // some were missed
        events->pairs_done = (uint8_t)(ended - BT_EVENTS_APART);
        events->now += 2 * (events->pairs_done - begun);
        forget_pairs(events);
    }
    const unsigned pairs = ended - events->pairs_done;
    follow(events, pac + 2 * events->pairs_done, pairs);
    const uint32_t level = evidence_unit(events);
    const uint32_t unit = events->slipping || level > BEGIN_MIN_COUNT2 ? level : BEGIN_MIN_COUNT2;
    const bool shook = shakes(events);
    look(events, pairs, unit);
    for (unsigned k = 0; k < BT_EVENTS_APART; k++) {
        events->four[k] = events->four[k + pairs];
    }
    events->now += 2 * pairs;
    events->pairs_done = (uint8_t)(events->pairs_done + pairs);
    const bool slip_continues = events->slipping && events->touched && shakes(events);
    uint32_t raised = (shook || shakes(events) || events->landing) && !slip_continues
                          ? raise_events(events, level, unit)
                          : 0;
    if (!events->touched && tare->state == BT_TARE_STATE_CONTACT) {
        raised |= touched_again(events, tare);
    }
    if (end == BT_PAC_PER_FRAME) {
        end_round(events, tare);
    }
    return raised;
}

// ---- messages

static uint32_t since_us(const bt_events *events, uint32_t sample)
{
    uint32_t samples = events->now - 1 - sample;
    return samples / BT_PAC_PER_FRAME * (BT_FRAME_MS * 1000)
           + samples % BT_PAC_PER_FRAME * (BT_FRAME_MS * 1000) / BT_PAC_PER_FRAME;
}

void bt_events_message(bt_events *events, uint8_t event, const bt_tare *tare, uint32_t t_us,
                       bt_msg_event *msg)
{
    const bool shaken = event >= BT_EVENT_KIND_JOLT;
    msg->kind = event;
    msg->tare_state = tare->state;
    msg->t_us = t_us;
    msg->onset_us = t_us;
    if (event == BT_EVENT_KIND_JOLT) {
        msg->onset_us -= since_us(events, events->shake_began);
    } else if (event == BT_EVENT_KIND_SLIP) {
        msg->onset_us = events->slip_us = t_us - since_us(events, events->slip_began);
    } else if (event == BT_EVENT_KIND_STUCK) {
        msg->onset_us = events->slip_us;
    }
    msg->energy_count2 = shaken ? UINT32_MAX : events->energy_count2;
    msg->peak_count = event == BT_EVENT_KIND_JOLT || event == BT_EVENT_KIND_SLIP
                          ? (uint16_t)(square_root(events->peak_count2) / 4)
                          : BT_INVALID_COUNT;
}
