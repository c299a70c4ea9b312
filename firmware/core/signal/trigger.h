// The trigger filters every word of an electrode, or of static pressure, as it arrives. It removes
// single-sample glitches and adds the word's squared distance from rest to the round's energy, so that a
// touch is seen in the slot in which it happens and not at the end of the round.
//
// Real glitches are single samples, 28 to 66 counts off. One round in ten has one, and one alone exceeds the
// contact threshold. So a word far from rest is held back until the lane's next word: if that is far too, it
// is a touch. (The distance from the previous word would be worse: it adds that word's noise, and a glitch
// that slipped through would hold back the return.) While no touch is expected, with no tare or a frozen one,
// a jump from word to word must be confirmed instead.
//
// A missing or railed word repeats the filter's value, so that it neither looks like motion nor enters a
// tare; repeats are never published. An electrode that a press brings to the low end of its range is not
// railed: its word is a bound, compressed at least as far as a count of 1.
//
// Units: counts; energies in count^2 summed over electrodes. Only `rest` is rounded, to the tare in whole
// counts: that changes the energy by at most |e| + 1/4 per electrode.
#ifndef BIOTAC_TRIGGER_H
#define BIOTAC_TRIGGER_H

#include "signal/round.h"

#ifndef BT_CDEF
#include "fixed_point.h"
#endif

#define BT_LANES    (BT_ELECTRODES + 1) // filtered channels: the electrodes, then static pressure
#define BT_LANE_PDC BT_ELECTRODES

// One value per lane. Pairs add two at a time; no sum carries over.
typedef union {
    uint16_t lane[BT_LANES];
    uint32_t pair[BT_LANES / 2];
} bt_lanes;

#ifndef BT_CDEF
static inline void bt_lanes_add(bt_lanes *sum, const bt_lanes *lanes)
{
    BT_UNROLL
    for (unsigned k = 0; k < BT_LANES / 2; k++) {
        sum->pair[k] += lanes->pair[k];
    }
}
#endif

// `smooth` and `rest` of a lane without a good word so far: adds no energy, is far from every first word, and
// eight of it fit a sweep's sum.
#define BT_TRIGGER_UNREAD 8191

typedef struct {
    bt_lanes smooth; // the filter's value
    bt_lanes rest;   // reference for the distance
    int32_t room;    // energy left until the trigger fires; negative once it has
    int32_t limit;   // `room` at the start of the round
    uint32_t far;    // bit mask of lanes with a word far off in this round, held back or not
    uint32_t far_before;
    uint32_t up; // lanes that jumped in this round by more than BT_TRIGGER_JUMP from the filter's value
    uint32_t down;
    uint32_t leapt;   // likewise, by more than BT_TRIGGER_LEAP either way
    uint32_t usable;  // counts from 2 on that need no look: all in range, or none while electrodes are out
    uint32_t without; // electrodes without a word in this round: missing, railed or condemned
    uint32_t odd;     // these, and those at a bound
    uint32_t unknown; // lanes without a good word so far
    uint32_t first_words; // lanes with a first good word, until the owner has used it
    uint32_t out;         // electrodes condemned by health.h: words not to be used
    bool pressure_now;    // this round had a good pressure word
} bt_trigger;

// More than any round can use up: a trigger with this limit never fires.
#define BT_TRIGGER_NEVER (1 << 30)

void bt_trigger_reset(bt_trigger *trigger);

// Begin a round; the trigger fires when the energy exceeds limit_count2.
#ifndef BT_CDEF
static inline void bt_trigger_begin(bt_trigger *trigger, int32_t limit_count2)
{
    trigger->limit = limit_count2;
    trigger->room = limit_count2;
    trigger->far_before = trigger->far;
    trigger->far = 0;
    trigger->up = 0;
    trigger->down = 0;
    trigger->leapt = 0;
    trigger->without = 0;
    trigger->odd = 0;
}
#endif

// The rare words: at a rail or excluded, and far off. The first returns the room left, the second the
// filter's new value.
int32_t bt_trigger_doubt(bt_trigger *trigger, unsigned electrode, uint16_t count);
uint16_t bt_trigger_far(bt_trigger *trigger, unsigned lane, uint16_t count);

// Exclude these electrodes from the next round on.
void bt_trigger_leave_out(bt_trigger *trigger, uint32_t electrodes);

#define BT_TRIGGER_FAR   24 // counts: less than any glitch, nearly five sigma of a worn sensor's noise
#define BT_TRIGGER_JUMP  48
#define BT_TRIGGER_LEAP  72 // more than any glitch
#define BT_TRIGGER_BOUND 1  // up to this count a compressed electrode is at the low rail

#ifndef BT_CDEF // called in every slot, hence inline
static inline uint16_t bt_trigger_filter(bt_trigger *trigger, unsigned lane, uint16_t count, uint16_t from)
{
    if ((uint32_t)count - from + BT_TRIGGER_FAR > 2 * BT_TRIGGER_FAR) {
        count = bt_trigger_far(trigger, lane, count);
    }
    trigger->smooth.lane[lane] = count;
    return count;
}

// Filter an electrode's word, 0..4095 or BT_INVALID_COUNT, while no touch is expected.
static inline void bt_trigger_follow(bt_trigger *trigger, unsigned electrode, uint16_t count)
{
    if ((uint32_t)count - 2 < trigger->usable) {
        (void)bt_trigger_filter(trigger, electrode, count, trigger->smooth.lane[electrode]);
    } else {
        (void)bt_trigger_doubt(trigger, electrode, count);
    }
}

// The same while a touch is expected. Returns the room left.
static inline int32_t bt_trigger_electrode(bt_trigger *trigger, unsigned electrode, uint16_t count)
{
    if ((uint32_t)count - 2 >= trigger->usable) {
        return bt_trigger_doubt(trigger, electrode, count);
    }
    uint16_t smooth = bt_trigger_filter(trigger, electrode, count, trigger->rest.lane[electrode]);
    int32_t e = smooth - trigger->rest.lane[electrode]; // a first word sets `rest`
    return trigger->room -= e * e;
}
#endif

// Filter the pressure word. Fires when the filter's value exceeds rest by more than `above`. Returns the room
// left.
int32_t bt_trigger_pressure(bt_trigger *trigger, uint16_t count, int32_t above);

// The round's energy so far.
#ifndef BT_CDEF
static inline uint32_t bt_trigger_energy(const bt_trigger *trigger)
{
    return (uint32_t)(trigger->limit - trigger->room);
}
#endif

#endif
