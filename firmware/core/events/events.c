#include "events/events.h"

#include "fixed_point.h"

#include <string.h>

// In squared changes of a noise of five counts, the worst of public recordings; a board's own noise raises
// it.
#define LEVEL_MIN 100
#define LEVEL_MAX 3200 // sigma 28: a finger that shakes more feels nothing by it
// In levels. Chosen on 100 real slides and 344 handovers, and on noise.
#define CAP       12  // of one sample: a glitch, which is two of them, is neither jolt nor slip
#define JOLT      25  // noise of sigma 5: no false one in ten minutes
#define SLIP      20  // of each side; likewise
#define MOST      100 // a slip is over when nothing has shaken for some 0.2 s
#define DRAG_COUNT2                                                                                          \
    (75 * 75)           // changes of drags: those of squeezes by up to 6 N/s are less, or last less than
#define DRAGGED     44  // so many samples, 20 ms
#define TOGETHER    18  // samples from rise to fall, 8 ms: of one vibration
#define NOISE_LOG   6   // rounds that its mean is over, as a power of two
#define LANDING_MIN 220 // samples, 0.1 s
#define LANDING_MAX 2200

#define TOLD(event) (1u << (event))

_Static_assert((uint64_t)LEVEL_MAX * CAP * BT_PAC_PER_FRAME * 745 <= UINT32_MAX,
               "the noise of a round, as a level, must fit its type");
_Static_assert((uint64_t)LEVEL_MAX * (2 * MOST + CAP * BT_PAC_PER_FRAME) * 2 <= UINT32_MAX,
               "evidence must fit its type");
_Static_assert((uint64_t)BT_ELECTRODES * BT_TRIGGER_UNREAD * BT_TRIGGER_UNREAD <= UINT32_MAX,
               "energy must fit its type");
_Static_assert((uint64_t)BT_FULL_SCALE_COUNT *BT_FULL_SCALE_COUNT <= INT32_MAX, "a square must fit its type");
_Static_assert((BT_FULL_SCALE_COUNT & (BT_FULL_SCALE_COUNT + 1)) == 0
                   && BT_INVALID_COUNT > BT_FULL_SCALE_COUNT,
               "bits above full scale tell words that are missing");
_Static_assert(2 * CAP < JOLT && CAP < 2 * SLIP, "one glitch must not be an event");
_Static_assert(DRAGGED + BT_PAC_PER_FRAME <= UINT8_MAX, "a count must fit its type");
_Static_assert(BT_PAC_PER_FRAME == 22, "745/8192 is 2/22");

void bt_events_reset(bt_events *events)
{
    memset(events, 0, sizeof *events);
    events->watched = BT_EVENTS_NO_SLOT;
    events->level_count2 = LEVEL_MIN;
    events->noise_count2 = LEVEL_MIN / 2 * BT_PAC_PER_FRAME;
}

// ---- touch and release
// ----------------------------------------------------------------------------------------------

static uint32_t square_of(const bt_tare *tare, unsigned electrode)
{
    int32_t e = tare->trigger.smooth.lane[electrode] - tare->trigger.rest.lane[electrode];
    return (uint32_t)(e * e);
}

// Energy of now; the slot of the strongest electrode is watched.
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
    return TOLD(BT_EVENT_KIND_TOUCH);
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
    return TOLD(BT_EVENT_KIND_LIFT);
}

// The tare machine goes on to call it a contact, so its trigger waits for no other.
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
// -----------------------------------------------------------------------------------------------

static void end_round(bt_events *events, const bt_tare *tare)
{
    if (!events->touched && tare->state == BT_TARE_STATE_REST) {
        int32_t more = (int32_t)(events->sum_count2 - events->noise_count2);
        events->noise_count2 += (uint32_t)bt_shift_down(more, NOISE_LOG);
        uint32_t level = events->noise_count2 * 745 >> 13;
        events->level_count2 = level < LEVEL_MIN ? LEVEL_MIN : level > LEVEL_MAX ? LEVEL_MAX : level;
    }
    events->sum_count2 = 0;
    events->done = 0;
}

// By how much a word differs from the one before it; not at all where either is missing.
static inline int32_t change_of(uint32_t count, uint32_t before)
{
    return (count | before) > BT_FULL_SCALE_COUNT ? 0 : (int32_t)(count - before);
}

// Samples that are noise and add nothing to nothing: most. Returns how many there are until one does.
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
    events->sum_count2 += sum;
    return k;
}

static inline uint32_t less(uint32_t evidence, uint32_t by)
{
    return evidence > by ? evidence - by : 0;
}

// The first sample that rises, or falls.
static BT_NOINLINE uint32_t since(const bt_events *events, const uint16_t *pac, const uint16_t *before,
                                  bool falls)
{
    unsigned k = 0;
    while ((change_of(pac[k], before[k]) <= 0) != falls) {
        k++;
    }
    return events->now + k;
}

// What the noise takes away again is taken at the end: these are at most eight samples. A drag changes
// slowly: the last of them stands for all.
static BT_NOINLINE void add_shaken(bt_events *events, const uint16_t *pac, const uint16_t *before,
                                   unsigned samples)
{
    const uint32_t cap = CAP * events->level_count2;
    uint32_t most = events->most_count2;
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
    events->most_count2 = most;
    events->sum_count2 += all;
    if (last >= DRAG_COUNT2 && events->dragged < DRAGGED) {
        events->dragged = (uint8_t)(events->dragged + samples);
    }
    const uint32_t fell = all - rose;
    if (events->rises == 0 && rose != 0) {
        events->rises_since = since(events, pac, before, false);
    }
    if (events->falls == 0 && fell != 0) {
        events->falls_since = since(events, pac, before, true);
    }
    const uint32_t top = MOST * events->level_count2;
    const uint32_t toll = events->level_count2 / 2 * samples;
    const uint32_t rises = less(events->rises + rose, toll);
    const uint32_t falls = less(events->falls + fell, toll);
    events->rises = rises > top ? top : rises;
    events->falls = falls > top ? top : falls;
}

// What can be no other event until it is over: a slip, or a jolt of what is not held yet.
static inline bool is_told(const bt_events *events)
{
    return events->slips || (events->jolted && (events->landing || !events->touched));
}

// Only how long it goes on is asked: both sides are one.
static BT_NOINLINE void go_on(bt_events *events, const uint16_t *pac, const uint16_t *before,
                              unsigned samples)
{
    const uint32_t cap = CAP * events->level_count2;
    const uint32_t most = 2 * MOST * events->level_count2;
    uint32_t all = 0;
    for (unsigned k = 0; k < samples; k++) {
        int32_t change = change_of(pac[k], before[k]);
        uint32_t square = (uint32_t)(change * change);
        all += square > cap ? cap : square;
    }
    events->sum_count2 += all;
    const uint32_t sum = less(events->rises + events->falls + all, samples * events->level_count2);
    events->rises = sum > most ? most : sum;
    events->falls = 0;
}

static inline bool shakes(const bt_events *events)
{
    return (events->rises | events->falls) != 0;
}

static inline void shake(bt_events *events, const uint16_t *pac, const uint16_t *before, unsigned samples)
{
    if (!shakes(events)) {
        events->began = events->now;
        events->most_count2 = 0;
        events->dragged = 0;
    }
    if (is_told(events)) {
        go_on(events, pac, before, samples);
    } else {
        add_shaken(events, pac, before, samples);
    }
    events->now += samples;
}

static uint32_t end_slip(bt_events *events)
{
    uint32_t told = events->slips ? TOLD(BT_EVENT_KIND_STUCK) : 0;
    events->slips = false;
    return told;
}

static uint32_t quiet(bt_events *events)
{
    events->jolted = false;
    events->landing = events->landing && events->now - events->touch_began < LANDING_MIN;
    return end_slip(events);
}

// Goes to and fro, since the earlier of the two where it is one vibration, else since the later; or has been
// dragged for so long, and slips from now on.
static bool begins_to_slip(bt_events *events)
{
    const uint32_t each = SLIP * events->level_count2;
    if (events->rises > each && events->falls > each) {
        const int32_t apart = (int32_t)(events->falls_since - events->rises_since);
        const bool one = apart <= TOGETHER && apart >= -TOGETHER;
        events->slip_began = (apart > 0) == one ? events->rises_since : events->falls_since;
        return true;
    }
    events->slip_began = events->now - 1;
    return events->dragged >= DRAGGED;
}

static inline uint32_t judge(bt_events *events)
{
    uint32_t told = 0;
    if (!shakes(events)) {
        return quiet(events);
    }
    if (!events->jolted && events->rises + events->falls > JOLT * events->level_count2) {
        events->jolted = true;
        told = TOLD(BT_EVENT_KIND_JOLT);
    }
    if (!events->touched) {
        return told | end_slip(events);
    }
    events->landing = events->landing && events->now - events->touch_began < LANDING_MAX;
    if (!events->slips && !events->landing && begins_to_slip(events)) {
        events->slips = true;
        told |= TOLD(BT_EVENT_KIND_SLIP);
    }
    return told;
}

uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end)
{
    uint32_t told = 0;
    unsigned k = events->done < end ? events->done : 0;
    const uint16_t *before;
    if (k > 0) {
        before = pac + k - BT_EVENTS_LAG;
    } else if (end == BT_EVENTS_LAG) {
        before = pac + BT_PAC_PER_FRAME - BT_EVENTS_LAG; // still those of the round before
    } else {
        k = BT_EVENTS_LAG; // they may be gone
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
    events->done = (uint8_t)end;
    const bool goes_on = events->slips && events->touched && shakes(events);
    if ((shook || events->landing) && !goes_on) {
        told = judge(events);
    }
    if (!events->touched && tare->state == BT_TARE_STATE_CONTACT) {
        told |= touched_again(events, tare);
    }
    if (end == BT_PAC_PER_FRAME) {
        end_round(events, tare);
    }
    return told;
}

// ---- messages
// -------------------------------------------------------------------------------------------------------

static uint32_t since_us(const bt_events *events, uint32_t sample)
{
    uint32_t samples = events->now - 1 - sample;
    return samples / BT_PAC_PER_FRAME * (BT_FRAME_MS * 1000)
           + samples % BT_PAC_PER_FRAME * (BT_FRAME_MS * 1000) / BT_PAC_PER_FRAME;
}

static uint16_t root(uint32_t square)
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
        msg->onset_us -= since_us(events, events->began);
    } else if (event == BT_EVENT_KIND_SLIP) {
        msg->onset_us = events->slip_us = t_us - since_us(events, events->slip_began);
    } else if (event == BT_EVENT_KIND_STUCK) {
        msg->onset_us = events->slip_us;
    }
    msg->energy_count2 = shaken ? UINT32_MAX : events->energy_count2;
    msg->peak_count = event == BT_EVENT_KIND_JOLT || event == BT_EVENT_KIND_SLIP ? root(events->most_count2)
                                                                                 : BT_INVALID_COUNT;
}
