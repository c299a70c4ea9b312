// Sensor health: which electrodes to exclude, and whether to trust the sensor at all.
//
// The skin holds one body of fluid: where a touch squeezes it in one place it bulges in others, so that no
// touch moves an electrode alone. In 80 000 rounds of real fingers, pressed and sheared on plates, one
// electrode moved at most 2.2 times as far as all others together, where noise does not hide the others. An
// electrode that moves by more than 5 times their sum is suspected; by twice that, it is broken. So is an
// electrode that repeats one count while the others move, or jumps back and forth. A sensor that repeats all
// words is frozen: a live one has noise.
//
// A condemned electrode is reinstated at rest, after two calm seconds near the tare.
//
// Four rounds are a window. The work is spread: while a window fills, the one before is searched for repeated
// words and enters the running means. The means are then compared with the anchor, where the skin last moved.
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
    bt_lanes sum[2];         // filtered counts of two windows: the filling one and the one before
    uint8_t filling;         // index of the filling window
    uint8_t rounds;          // in the filling window
    uint8_t windows;         // since all electrodes were anchored; saturates
    uint8_t judged;          // windows; wraps
    bool pressure_alive;     // static pressure has moved
    uint32_t out;            // condemned electrodes, a bit mask
    uint8_t electrode_fault; // enum bt_sensor_fault of the latest condemned
    uint8_t sensor_fault;    // enum bt_sensor_fault of a fault that passes by itself
    bool exchanged;          // until a host tares
    uint8_t calm_rounds;     // without a touch
    bool was_touched;        // before the calm rounds
    uint8_t still_rounds;    // since pressure was far off; saturates
    uint32_t up, down;       // those of the trigger, of the round before
    uint32_t flips[3];       // electrodes that jumped back and forth once, twice, three times lately
    bt_lanes mean;           // running: a quarter of the way to every window
    bt_lanes anchor;         // the means when the skin last moved
    bt_moves moves;          // from anchor to mean
    uint32_t same;           // electrodes that read one count throughout the window
    uint32_t unchanged;      // electrodes that did so for unchanged_windows
    uint8_t unchanged_windows;
    uint8_t longest;       // most windows for which an electrode repeated a word and then changed it
    uint8_t alive_windows; // in which words changed; saturates: only a live sensor is soon called frozen
    uint8_t calm_windows;  // in which no condemned electrode moved; saturates
    uint16_t travel_q4;    // sum of the others' moves while some were unchanged; saturates
    uint32_t unknown;      // that of the trigger, of the window before
    uint32_t suspect;      // electrodes that moved alone in this window, far enough to be broken
    uint32_t alone;        // electrodes that moved alone in this touch
    uint16_t sd_q4;        // noise of a difference of two means
} bt_health;

// End a round: check the words. `touched`: something may touch the finger.
void bt_health_round(bt_health *health, const bt_round *round, const bt_trigger *trigger,
                     const bt_noise *noise, bool touched);

// Reinstate condemned electrodes that are calm. Call it at rest, or while too many are out.
void bt_health_back(bt_health *health);

#ifndef BT_CDEF
// The fault of the whole sensor, an enum bt_sensor_fault.
static inline uint8_t bt_health_sensor_fault(const bt_health *health)
{
    bool exchanged = health->exchanged && health->sensor_fault == BT_SENSOR_FAULT_NONE;
    return exchanged ? BT_SENSOR_FAULT_EXCHANGED : health->sensor_fault;
}

// A new tare holds every common shift. Only a host knows which sensor was tared.
static inline void bt_health_tared(bt_health *health, bool by_host)
{
    health->exchanged = health->exchanged && !by_host;
    if (health->sensor_fault == BT_SENSOR_FAULT_TOGETHER) {
        health->sensor_fault = BT_SENSOR_FAULT_NONE;
    }
}
#endif

#endif
