// What a live sensor's words cannot be: which electrodes to do without, and whether to trust the sensor.
//
// Under the skin is one body of fluid: what squeezes it in one place lets it bulge in others, and no touch
// moves an electrode alone. Of 80 000 rounds of real fingers, pressed and sheared on plates, one electrode
// moved at most 5.7 times as far as all others together, as long as noise does not hide those. So an
// electrode that moves by more than 8 times their sum is broken, and so is one that keeps saying one count
// while they move, or jumps back and forth. And no living sensor repeats all its words: each has its noise.
//
// A condemned electrode is given back at rest, with a new tare, once it has been calm for two seconds.
//
// Units: counts; sums over a window of four rounds are in 1/4 count (q2).
#ifndef BIOTAC_HEALTH_H
#define BIOTAC_HEALTH_H

#include "signal/noise.h"
#include "signal/trigger.h"

// What the filtered counts of some rounds sum up to, and summed up to when the skin last moved.
typedef struct {
    bt_lanes sum, anchor;
} bt_health_window;

typedef struct {
    uint32_t out;            // electrodes condemned, a bit mask
    uint8_t electrode_fault; // enum bt_sensor_fault of the latest of these
    uint8_t sensor_fault;    // enum bt_sensor_fault
    uint32_t same;           // electrodes whose word of this round is that of the round before
    uint32_t unchanged;      // electrodes that have said one count for unchanged_rounds
    uint16_t unchanged_rounds;
    uint8_t longest_rounds; // in which some electrode of this sensor repeated its word and then changed it
    bool pressure_alive;    // static pressure has moved
    uint16_t travel_q2;     // by how much the others moved in these, summed up; saturates
    uint8_t same_rounds;    // in which all electrodes repeated their words
    uint8_t alive_rounds;   // in which they did not; saturates: only what was alive can freeze
    uint32_t up, down;      // trigger's, of the round before
    uint8_t flips[BT_ELECTRODES];
    bool flipping; // not all flips are 0
    bt_health_window fast, slow;
    bool anchored;   // both have anchors
    uint8_t rounds;  // of the fast window
    uint8_t windows; // of the slow one
    uint16_t anchor_tdc;
    uint8_t anchor_rounds; // since the fast anchors were set; saturates
    uint32_t suspect;      // electrodes that the fast window before was the first to see moving alone
    uint32_t alone_fast;   // electrodes that have moved alone since their anchors were set
    uint32_t alone_slow;
    uint32_t alone;            // in this touch: those that did
    uint8_t calm_windows;      // in which no condemned electrode moved; saturates
    uint32_t noise_count2;     // the noise that the limits are for
    uint16_t fast_sd, slow_sd; // of a difference of two windows' sums, by noise
} bt_health;

void bt_health_reset(bt_health *health);

// Take an electrode's word and the one before. Returns the word to use.
#ifndef BT_CDEF // called for every electrode in every round, hence inline
static inline uint16_t bt_health_word(bt_health *health, unsigned electrode, uint16_t count, uint16_t before)
{
    if (count == before) {
        health->same |= 1u << electrode;
    }
    return health->out != 0 && health->out >> electrode & 1 ? BT_INVALID_COUNT : count;
}
#endif

// End a round: judge its words. `touched`: something may touch the finger. With FROZEN, trigger.without
// becomes all electrodes.
void bt_health_round(bt_health *health, const bt_round *round, bt_trigger *trigger, const bt_noise *noise,
                     bool touched);

// Returns the electrodes to be used again from the next round on, and forgets that they were condemned. Call
// it while the finger rests, or while too many are out.
uint32_t bt_health_back(bt_health *health);

// There is a new tare: whatever has moved together is in it.
#ifndef BT_CDEF
static inline void bt_health_tared(bt_health *health)
{
    if (health->sensor_fault == BT_SENSOR_FAULT_TOGETHER) {
        health->sensor_fault = BT_SENSOR_FAULT_NONE;
    }
}
#endif

#endif
