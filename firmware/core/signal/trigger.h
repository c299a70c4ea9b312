// The trigger takes every word of an electrode, or of static pressure, as it arrives. It removes
// single-sample glitches and adds the word's squared distance from rest to the round's energy, so that a
// touch is seen in the slot in which it happens and not at the end of the round.
//
// A real sensor's glitches are single samples that are 28 to 66 counts off. One round in ten has one, and one
// alone exceeds the contact threshold. So a word far from rest is held back until the lane's next word: if
// that is far too, it is a touch. (Measuring from the previous word would be worse: its noise would count as
// well, and the return from a glitch that slipped through would be held back too.) While no touch is
// expected, because there is no tare or it is frozen, a jump from word to word must be confirmed instead.
//
// A missing or railed word repeats the filter's value, so that it neither looks like motion nor enters
// a tare; what is repeated is never published. An electrode that a press brings to the low end of its range
// is not railed: its word is a bound, which says that it is compressed at least so far as a count of 1.
//
// Units: counts; energies in count^2 summed over electrodes. Nothing is rounded except `rest`, which is the
// tare in whole counts: that changes the energy by at most |e| + 1/4 per electrode.
#ifndef BIOTAC_TRIGGER_H
#define BIOTAC_TRIGGER_H

#include "signal/round.h"

#ifndef BT_CDEF
#include "fixed_point.h"
#endif

#define BT_LANES    (BT_ELECTRODES + 1) // what is filtered: the electrodes, then static pressure
#define BT_LANE_PDC BT_ELECTRODES

// One value per lane; pairs are for adding two at a time, where no sum carries into its neighbour.
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

// `smooth` and `rest` of a lane that never had a good word: it adds no energy, every first word is far from
// it, and a sweep's sum has room for eight of it.
#define BT_TRIGGER_UNREAD 8191

typedef struct {
    bt_lanes smooth; // the filter's value
    bt_lanes rest;   // what it is compared with
    int32_t room;    // energy left until the trigger fires; negative once it has
    int32_t limit;   // `room` at the start of the round
    uint32_t far;    // bit mask of lanes whose word of this round was far off, held back or not
    uint32_t far_before;
    uint32_t up; // lanes whose word of this round jumped by more than BT_TRIGGER_JUMP from the filter's value
    uint32_t down;
    uint32_t leapt; // likewise, by more than BT_TRIGGER_LEAP either way
    uint32_t
        usable; // so many counts from 2 on are used unseen: all in range, or none while electrodes are out
    uint32_t without;     // electrodes whose word of this round is not used: missing, railed or condemned
    uint32_t odd;         // these, and those whose word is a bound
    uint32_t unknown;     // lanes without a good word so far
    uint32_t first_words; // lanes whose first good word has come, until the owner takes note of it
    uint32_t out;         // electrodes whose words are not to be used: those that health.h has condemned
    bool pressure_now;    // this round had a good pressure word
} bt_trigger;

// More than any round can use up: a trigger with this limit never fires.
#define BT_TRIGGER_NEVER (1 << 30)

void bt_trigger_reset(bt_trigger *trigger);

// Begin a round; the trigger fires when its energy exceeds limit_count2.
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

// The rare cases: a word at an end of its range or not to be used, and one that is far off. The first returns
// the room left, the second the filter's new value.
int32_t bt_trigger_doubt(bt_trigger *trigger, unsigned electrode, uint16_t count);
uint16_t bt_trigger_far(bt_trigger *trigger, unsigned lane, uint16_t count);

// Do without these electrodes' words from the next round on.
void bt_trigger_leave_out(bt_trigger *trigger, uint32_t electrodes);

#define BT_TRIGGER_FAR   24 // counts: less than any glitch, nearly five sigma of a worn sensor's noise
#define BT_TRIGGER_JUMP  48
#define BT_TRIGGER_LEAP  72 // more than any glitch
#define BT_TRIGGER_BOUND 1  // up to this count a compressed electrode is at the end of its range

#ifndef BT_CDEF // called in every slot, hence inline
static inline uint16_t bt_trigger_filter(bt_trigger *trigger, unsigned lane, uint16_t count, uint16_t from)
{
    if ((uint32_t)count - from + BT_TRIGGER_FAR > 2 * BT_TRIGGER_FAR) {
        count = bt_trigger_far(trigger, lane, count);
    }
    trigger->smooth.lane[lane] = count;
    return count;
}

// Take an electrode's word, 0..4095 or BT_INVALID_COUNT, while no touch is expected.
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
    int32_t e = smooth - trigger->rest.lane[electrode]; // a first word sets its own rest
    return trigger->room -= e * e;
}
#endif

// Take the pressure word. Fires the trigger when the filter's value exceeds rest by more than `above`.
// Returns the room left.
int32_t bt_trigger_pressure(bt_trigger *trigger, uint16_t count, int32_t above);

// The round's energy so far.
#ifndef BT_CDEF
static inline uint32_t bt_trigger_energy(const bt_trigger *trigger)
{
    return (uint32_t)(trigger->limit - trigger->room);
}
#endif

#endif
