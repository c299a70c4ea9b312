// What a live sensor's words cannot be: which electrodes to do without, and whether to trust the sensor.
//
// Under the skin is one body of fluid: what squeezes it in one place lets it bulge in others, and no touch
// moves an electrode alone. Of 80 000 rounds of real fingers, pressed and sheared on plates, one electrode
// moved at most 2.2 times as far as all others together, as long as noise does not hide those. So an
// electrode that moves by more than 5 times their sum is suspected, and one that does so twice over is
// broken; and so is what keeps saying one count while they move, or jumps back and forth. And no living
// sensor repeats all its words: each has its noise.
//
// A condemned electrode is used again at rest, once it has been calm near its tare for two seconds.
//
// Four rounds are a window. No round pays for everything: while a window fills, the one before is searched
// for words that repeat, and enters the running means; then these are compared with where they were when the
// skin last moved, and judged.
//
// Units: counts; a window's sums are in 1/4 count (q2), running means in 1/16 count (q4).
#ifndef BIOTAC_HEALTH_H
#define BIOTAC_HEALTH_H

#include "signal/leap.h"
#include "signal/moves.h"
#include "signal/noise.h"
#include "signal/trigger.h"

typedef struct {
    bt_leap leap;
    bt_lanes sum[2];         // of a window's filtered counts: the one that fills, and the one before
    uint8_t filling;         // which
    uint8_t rounds;          // in it
    uint8_t windows;         // judged since all electrodes were anchored; saturates
    uint8_t judged;          // windows; wraps
    bool pressure_alive;     // static pressure has moved
    uint32_t out;            // electrodes condemned, a bit mask
    uint8_t electrode_fault; // enum bt_sensor_fault of the latest of these
    uint8_t sensor_fault;    // enum bt_sensor_fault of what passes by itself
    bool exchanged;          // until a host tares
    uint8_t calm_rounds;     // in which nothing touched
    bool was_touched;        // before these
    uint8_t still_rounds;    // since pressure was far off; saturates
    uint32_t up, down;       // trigger's, of the round before
    uint32_t flips[3];       // electrodes that jumped back and forth once, twice, three times lately
    bt_lanes mean;           // running: goes a quarter of the way to every window
    bt_lanes anchor;         // the means when the skin last moved
    bt_moves moves;          // since then
    uint32_t same;           // electrodes that said one count throughout the window
    uint32_t unchanged;      // that did so for unchanged_windows
    uint8_t unchanged_windows;
    uint8_t longest; // windows in which an electrode of this sensor repeated its word, and then changed it
    uint8_t alive_windows; // in which words changed; saturates: only what was alive is soon called frozen
    uint8_t calm_windows;  // in which no condemned electrode moved; saturates
    uint16_t travel_q4;    // by how much the others moved while some were unchanged; saturates
    uint32_t unknown;      // trigger's, of the window before
    uint32_t suspect;      // electrodes that in this window moved so far alone that they are broken
    uint32_t alone;        // in this touch: those that moved alone
    uint16_t sd_q4;        // of a difference of two means, by noise
} bt_health;

// End a round: judge its words. `touched`: something may touch the finger.
void bt_health_round(bt_health *health, const bt_round *round, const bt_trigger *trigger,
                     const bt_noise *noise, bool touched);

// Forget that electrodes were condemned, if they may be used again. Call it while the finger rests, or while
// too many are out.
void bt_health_back(bt_health *health);

#ifndef BT_CDEF
// What is wrong with the whole sensor, an enum bt_sensor_fault.
static inline uint8_t bt_health_sensor_fault(const bt_health *health)
{
    bool exchanged = health->exchanged && health->sensor_fault == BT_SENSOR_FAULT_NONE;
    return exchanged ? BT_SENSOR_FAULT_EXCHANGED : health->sensor_fault;
}

// There is a new tare: whatever has moved together is in it. Only a host knows whose words are tared.
static inline void bt_health_tared(bt_health *health, bool by_host)
{
    health->exchanged = health->exchanged && !by_host;
    if (health->sensor_fault == BT_SENSOR_FAULT_TOGETHER) {
        health->sensor_fault = BT_SENSOR_FAULT_NONE;
    }
}
#endif

#endif
