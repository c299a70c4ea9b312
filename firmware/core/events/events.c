#include "events/events.h"

#include "fixed_point.h"

#include <string.h>

// In squared changes of a noise of five counts, the worst of public recordings; a board's own noise raises
// it.
#define LEVEL_MIN   100
#define LEVEL_MAX   3200 // sigma 28: a finger that shakes more feels nothing by it
// In levels. Chosen on 100 real slides and 344 handovers, and on noise.
#define CAP         12  // of one sample: a glitch, which is two of them, is neither jolt nor slip
#define JOLT        25  // noise of sigma 5: no false one in ten minutes
#define SLIP        20  // of each side; likewise
#define MOST        100 // a slip is over when nothing has shaken for some 0.2 s
#define DRAGGED     55  // samples of as much as counts, 25 ms: 20 to 30 ms do as well
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
    memset(events->before, 0xFF, sizeof events->before);
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

static void end_round(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME])
{
    if (!events->touched && tare->state == BT_TARE_STATE_REST) {
        int32_t more = (int32_t)(events->sum_count2 - events->noise_count2);
        events->noise_count2 += (uint32_t)bt_shift_down(more, NOISE_LOG);
        uint32_t level = events->noise_count2 * 745 >> 13;
        events->level_count2 = level < LEVEL_MIN ? LEVEL_MIN : level > LEVEL_MAX ? LEVEL_MAX : level;
    }
    events->sum_count2 = 0;
    events->done = 0;
    for (unsigned k = 0; k < BT_EVENTS_LAG; k++) {
        events->before[k] = pac[BT_PAC_PER_FRAME - BT_EVENTS_LAG + k];
    }
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

// What a peak and the noise at rest want to know besides.
static BT_NOINLINE void size_up(bt_events *events, const uint16_t *pac, const uint16_t *before,
                                unsigned samples)
{
    const uint32_t cap = CAP * events->level_count2;
    for (unsigned k = 0; k < samples; k++) {
        int32_t change = change_of(pac[k], before[k]);
        uint32_t square = (uint32_t)(change * change);
        events->most_count2 = square > events->most_count2 ? square : events->most_count2;
        events->sum_count2 += square > cap ? cap : square;
    }
}

static BT_NOINLINE void add_shaken(bt_events *events, const uint16_t *pac, const uint16_t *before,
                                   unsigned samples)
{
    const uint32_t toll = events->level_count2 / 2;
    const uint32_t cap = CAP * events->level_count2;
    const uint32_t most = MOST * events->level_count2;
    uint32_t rises = events->rises;
    uint32_t falls = events->falls;
    uint32_t violent = events->violent;
    for (unsigned k = 0; k < samples; k++) {
        int32_t change = change_of(pac[k], before[k]);
        uint32_t square = (uint32_t)(change * change);
        if (square >= cap) {
            square = cap;
            violent++;
        }
        if (change > 0) {
            if (rises == 0) {
                events->rises_since = events->now + k;
            }
            rises += square;
        } else {
            if (falls == 0) {
                events->falls_since = events->now + k;
            }
            falls += square;
        }
        rises = less(rises, toll);
        falls = less(falls, toll);
    }
    events->rises = rises > most ? most : rises;
    events->falls = falls > most ? most : falls;
    events->violent = (uint8_t)(violent > DRAGGED ? DRAGGED : violent);
}

// Of a slip only how long it goes on is asked: both sides are one.
static BT_NOINLINE void go_on_slipping(bt_events *events, const uint16_t *pac, const uint16_t *before,
                                       unsigned samples)
{
    const uint32_t cap = CAP * events->level_count2;
    const uint32_t most = 2 * MOST * events->level_count2;
    uint32_t sum = events->rises + events->falls;
    for (unsigned k = 0; k < samples; k++) {
        int32_t change = change_of(pac[k], before[k]);
        uint32_t square = (uint32_t)(change * change);
        sum += square > cap ? cap : square;
    }
    sum = less(sum, samples * events->level_count2);
    events->rises = sum > most ? most : sum;
    events->falls = 0;
}

static inline bool shakes(const bt_events *events)
{
    return (events->rises | events->falls) != 0;
}

static BT_NOINLINE void shake(bt_events *events, const uint16_t *pac, const uint16_t *before,
                              unsigned samples)
{
    if (!shakes(events)) {
        events->began = events->now;
        events->most_count2 = 0;
        events->violent = 0;
    }
    if (events->slips) {
        go_on_slipping(events, pac, before, samples);
    } else {
        size_up(events, pac, before, samples);
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
    return events->violent >= DRAGGED;
}

static BT_NOINLINE uint32_t judge(bt_events *events)
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
    unsigned k = events->done;
    if (end <= k) { // the last of the round before were left out
        memset(events->before, 0xFF, sizeof events->before);
        k = 0;
    }
    bool shook = shakes(events);
    while (k < end) {
        const uint16_t *before = k < BT_EVENTS_LAG ? events->before + k : pac + k - BT_EVENTS_LAG;
        const unsigned to = k < BT_EVENTS_LAG && end > BT_EVENTS_LAG ? BT_EVENTS_LAG : end;
        const unsigned passed = shakes(events) ? 0 : pass_quiet(events, pac + k, before, to - k);
        events->now += passed;
        if (k + passed < to) {
            shake(events, pac + k + passed, before + passed, to - k - passed);
            shook = true;
        }
        k = to;
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
        end_round(events, tare, pac);
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
