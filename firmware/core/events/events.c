#include "events/events.h"

#include "fixed_point.h"

#include <string.h>

// For noise of five counts, the worst in public recordings; a board's own noise raises it.
#define LEVEL_MIN_COUNT2      100
#define LEVEL_MAX_COUNT2      3200 // sigma 28; a noisier finger cannot feel anything by PAC
// In levels; chosen on 100 real slides, 344 handovers and noise.
#define SAMPLE_CAP_LEVELS     12  // per sample: a glitch, which is two changes, must be no event
#define JOLT_LEVELS           25  // no false jolt in ten minutes of noise of sigma 5
#define SLIP_LEVELS           20  // on each side; likewise
#define SIDE_CAP_LEVELS       100 // a slip ends once nothing has shaken for some 0.2 s
// A drag: changes larger or longer than squeezes of up to 6 N/s make
#define DRAG_CHANGE_COUNT2    (75 * 75)
#define DRAG_SAMPLES          44 // 20 ms
// Times in samples, except NOISE_ROUNDS_LOG2
#define ONE_VIBRATION_SAMPLES 18  // between rise and fall; 8 ms
#define LANDING_MIN_SAMPLES   220 // 0.1 s
#define LANDING_MAX_SAMPLES   2200
#define NOISE_ROUNDS_LOG2     6 // rounds that the noise is averaged over

#define EVENT(event) (1u << (event))

_Static_assert((uint64_t)LEVEL_MAX_COUNT2 * SAMPLE_CAP_LEVELS * BT_PAC_PER_FRAME * 745 <= UINT32_MAX,
               "the noise of a round, as a level, must fit its type");
_Static_assert((uint64_t)LEVEL_MAX_COUNT2 * (2 * SIDE_CAP_LEVELS + SAMPLE_CAP_LEVELS * BT_PAC_PER_FRAME) * 2
                   <= UINT32_MAX,
               "evidence must fit its type");
_Static_assert((uint64_t)BT_ELECTRODES * BT_TRIGGER_UNREAD * BT_TRIGGER_UNREAD <= UINT32_MAX,
               "energy must fit its type");
_Static_assert((uint64_t)BT_FULL_SCALE_COUNT *BT_FULL_SCALE_COUNT <= INT32_MAX, "a square must fit its type");
_Static_assert((BT_FULL_SCALE_COUNT & (BT_FULL_SCALE_COUNT + 1)) == 0
                   && BT_INVALID_COUNT > BT_FULL_SCALE_COUNT,
               "a bit above full scale must mark a missing word");
_Static_assert(2 * SAMPLE_CAP_LEVELS < JOLT_LEVELS && SAMPLE_CAP_LEVELS < 2 * SLIP_LEVELS,
               "one glitch must not be an event");
_Static_assert(DRAG_SAMPLES + BT_PAC_PER_FRAME <= UINT8_MAX, "a count must fit its type");
_Static_assert(BT_PAC_PER_FRAME == 22, "745/8192 is 2/22");

void bt_events_reset(bt_events *events)
{
    memset(events, 0, sizeof *events);
    events->watched = BT_EVENTS_NO_SLOT;
    events->level_count2 = LEVEL_MIN_COUNT2;
    events->noise_count2 = LEVEL_MIN_COUNT2 / 2 * BT_PAC_PER_FRAME;
}

// ---- touch and release

static uint32_t square_of(const bt_tare *tare, unsigned electrode)
{
    int32_t e = tare->trigger.smooth.lane[electrode] - tare->trigger.rest.lane[electrode];
    return (uint32_t)(e * e);
}

// Sum up the energy, and watch the slot of the strongest electrode.
static BT_NOINLINE void weigh(bt_events *events, const bt_tare *tare)
{
    uint32_t strongest = 0;
    events->energy_count2 = 0;
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        unsigned electrode = (unsigned)bt_slot_channel[slot] - BT_CHANNEL_E1;
        if (electrode < BT_ELECTRODES) {
            uint32_t square = square_of(tare, electrode);
            events->energy_count2 += square;
            if (square >= strongest) {
                strongest = square;
                events->watched = slot;
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

uint32_t bt_events_watch(bt_events *events, const bt_tare *tare)
{
    const uint32_t half = tare->threshold_count2 / 2;
    if (square_of(tare, (unsigned)bt_slot_channel[events->watched] - BT_CHANNEL_E1) > half) {
        return 0;
    }
    weigh(events, tare);
    if (events->energy_count2 > half || pressed(tare)) {
        return 0;
    }
    events->touched = false;
    events->watched = BT_EVENTS_NO_SLOT;
    return EVENT(BT_EVENT_KIND_LIFT);
}

// The tare machine may stay in contact after a LIFT; its trigger then waits for no new touch.
static BT_NOINLINE uint32_t touched_again(bt_events *events, const bt_tare *tare)
{
    weigh(events, tare);
    if (events->energy_count2 > tare->threshold_count2) {
        return begin_touch(events);
    }
    events->watched = BT_EVENTS_NO_SLOT;
    return 0;
}

// ---- dynamic pressure

static void end_round(bt_events *events, const bt_tare *tare)
{
    if (!events->touched && tare->state == BT_TARE_STATE_REST) {
        int32_t more = (int32_t)(events->round_sum_count2 - events->noise_count2);
        events->noise_count2 += (uint32_t)bt_shift_down(more, NOISE_ROUNDS_LOG2);
        uint32_t level = events->noise_count2 * 745 >> 13;
        events->level_count2 = level < LEVEL_MIN_COUNT2   ? LEVEL_MIN_COUNT2
                               : level > LEVEL_MAX_COUNT2 ? LEVEL_MAX_COUNT2
                                                          : level;
    }
    events->round_sum_count2 = 0;
    events->samples_done = 0;
}

// The difference of two words; 0 where either is missing.
static inline int32_t change_of(uint32_t count, uint32_t before)
{
    return (count | before) > BT_FULL_SCALE_COUNT ? 0 : (int32_t)(count - before);
}

// Skip samples that are mere noise while there is no evidence for it to reduce, which is most of the time.
// Returns how many.
static inline unsigned pass_quiet(bt_events *events, const uint16_t *pac, const uint16_t *before,
                                  unsigned samples)
{
    const uint32_t toll = events->level_count2 / 2;
    uint32_t sum = 0;
    unsigned k = 0;
    for (; k < samples; k++) {
        int32_t change = change_of(pac[k], before[k]);
        uint32_t square = (uint32_t)(change * change);
        if (square > toll) {
            break;
        }
        sum += square;
    }
    events->round_sum_count2 += sum;
    return k;
}

static inline uint32_t take_off(uint32_t evidence, uint32_t by)
{
    return evidence > by ? evidence - by : 0;
}

// The number of the first sample that rises, or falls.
static BT_NOINLINE uint32_t first_change(const bt_events *events, const uint16_t *pac, const uint16_t *before,
                                         bool falls)
{
    unsigned k = 0;
    for (;; k++) {
        int32_t change = change_of(pac[k], before[k]);
        if (falls ? change < 0 : change > 0) {
            return events->now + k;
        }
    }
}

// Add samples, at most eight, to the evidence, and subtract the noise once for all of them. For a drag only
// the last is checked: it stands for all, because a drag changes slowly.
static BT_NOINLINE void add_shaken(bt_events *events, const uint16_t *pac, const uint16_t *before,
                                   unsigned samples)
{
    const uint32_t cap = SAMPLE_CAP_LEVELS * events->level_count2;
    uint32_t most = events->peak_count2;
    uint32_t all = 0, rose = 0, last = 0;
    for (unsigned k = 0; k < samples; k++) {
        const uint32_t now = pac[k], then = before[k];
        if ((now | then) > BT_FULL_SCALE_COUNT) {
            continue;
        }
        const int32_t change = (int32_t)(now - then);
        const uint32_t square = (uint32_t)(change * change);
        last = square;
        most = square > most ? square : most;
        const uint32_t capped = square > cap ? cap : square;
        all += capped;
        if (change > 0) {
            rose += capped;
        }
    }
    events->peak_count2 = most;
    events->round_sum_count2 += all;
    if (last >= DRAG_CHANGE_COUNT2 && events->dragged < DRAG_SAMPLES) {
        events->dragged = (uint8_t)(events->dragged + samples);
    }
    const uint32_t fell = all - rose;
    if (events->risen_count2 == 0 && rose != 0) {
        events->rise_began = first_change(events, pac, before, false);
    }
    if (events->fallen_count2 == 0 && fell != 0) {
        events->fall_began = first_change(events, pac, before, true);
    }
    const uint32_t top = SIDE_CAP_LEVELS * events->level_count2;
    const uint32_t toll = events->level_count2 / 2 * samples;
    const uint32_t rises = take_off(events->risen_count2 + rose, toll);
    const uint32_t falls = take_off(events->fallen_count2 + fell, toll);
    events->risen_count2 = rises > top ? top : rises;
    events->fallen_count2 = falls > top ? top : falls;
}

// True while no other event may begin: during a slip, and after a jolt of a finger that is untouched or
// landing.
static inline bool event_is_on(const bt_events *events)
{
    return events->slipping || (events->jolt_raised && (events->landing || !events->touched));
}

// All that matters now is how long it lasts, so both sides are summed as one.
static BT_NOINLINE void go_on(bt_events *events, const uint16_t *pac, const uint16_t *before,
                              unsigned samples)
{
    const uint32_t cap = SAMPLE_CAP_LEVELS * events->level_count2;
    const uint32_t most = 2 * SIDE_CAP_LEVELS * events->level_count2;
    uint32_t all = 0;
    for (unsigned k = 0; k < samples; k++) {
        int32_t change = change_of(pac[k], before[k]);
        uint32_t square = (uint32_t)(change * change);
        all += square > cap ? cap : square;
    }
    events->round_sum_count2 += all;
    const uint32_t sum =
        take_off(events->risen_count2 + events->fallen_count2 + all, samples * events->level_count2);
    events->risen_count2 = sum > most ? most : sum;
    events->fallen_count2 = 0;
}

static inline bool shakes(const bt_events *events)
{
    return (events->risen_count2 | events->fallen_count2) != 0;
}

static inline void shake(bt_events *events, const uint16_t *pac, const uint16_t *before, unsigned samples)
{
    if (!shakes(events)) {
        events->shake_began = events->now;
        events->peak_count2 = 0;
        events->dragged = 0;
    }
    if (event_is_on(events)) {
        go_on(events, pac, before, samples);
    } else {
        add_shaken(events, pac, before, samples);
    }
    events->now += samples;
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

// Either rises and falls have both shown enough: the slip began with the earlier of the two if they are one
// vibration, else with the later. Or the skin has been dragged for long enough: the slip begins now.
static bool begins_to_slip(bt_events *events)
{
    const uint32_t each = SLIP_LEVELS * events->level_count2;
    if (events->risen_count2 > each && events->fallen_count2 > each) {
        const int32_t apart = (int32_t)(events->fall_began - events->rise_began);
        const bool one = apart <= ONE_VIBRATION_SAMPLES && apart >= -ONE_VIBRATION_SAMPLES;
        events->slip_began = (apart > 0) == one ? events->rise_began : events->fall_began;
        return true;
    }
    events->slip_began = events->now - 1;
    return events->dragged >= DRAG_SAMPLES;
}

static inline uint32_t judge(bt_events *events)
{
    uint32_t raised = 0;
    if (!shakes(events)) {
        return end_shaking(events);
    }
    if (!events->jolt_raised
        && events->risen_count2 + events->fallen_count2 > JOLT_LEVELS * events->level_count2) {
        events->jolt_raised = true;
        raised = EVENT(BT_EVENT_KIND_JOLT);
    }
    if (!events->touched) {
        return raised | end_slip(events);
    }
    events->landing = events->landing && events->now - events->touch_began < LANDING_MAX_SAMPLES;
    if (!events->slipping && !events->landing && begins_to_slip(events)) {
        events->slipping = true;
        raised |= EVENT(BT_EVENT_KIND_SLIP);
    }
    return raised;
}

uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end)
{
    uint32_t raised = 0;
    unsigned k = events->samples_done < end ? events->samples_done : 0;
    const uint16_t *before;
    if (k > 0) {
        before = pac + k - BT_EVENTS_LAG;
    } else if (end == BT_EVENTS_LAG) {
        before = pac + BT_PAC_PER_FRAME - BT_EVENTS_LAG; // still the previous round's
    } else {
        k = BT_EVENTS_LAG; // the previous round's may be gone
        before = pac;
        events->now += BT_EVENTS_LAG;
    }
    const unsigned samples = end - k;
    const unsigned passed = shakes(events) ? 0 : pass_quiet(events, pac + k, before, samples);
    const bool shook = passed < samples || shakes(events);
    events->now += passed;
    if (passed < samples) {
        shake(events, pac + k + passed, before + passed, samples - passed);
    }
    events->samples_done = (uint8_t)end;
    const bool goes_on = events->slipping && events->touched && shakes(events);
    if ((shook || events->landing) && !goes_on) {
        raised = judge(events);
    }
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

static uint16_t integer_root(uint32_t square)
{
    uint32_t found = 0;
    for (uint32_t bit = 1u << 12; bit != 0; bit >>= 1) {
        uint32_t more = found | bit;
        found = more * more <= square ? more : found;
    }
    return (uint16_t)found;
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
                          ? integer_root(events->peak_count2)
                          : BT_INVALID_COUNT;
}
