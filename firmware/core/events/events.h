// Events: that something touches, is let go, jolts or slips.
//
// Touch and release go by the electrodes' energy, each with its latest word. A resting finger's trigger says
// touch, in the slot of the word that fires it (signal/trigger.h). Of a touched finger one electrode is
// watched, the strongest: when it falls below half the trigger's threshold all are summed up, and when they
// do, too, and no pressure is left, it is a release; else the strongest of them is watched. So what falls
// last in a release is the word that tells it.
//
// Jolt and slip go by dynamic pressure (PAC), by how much it changed within eight samples, 3.6 ms: 70 to 200
// Hz, where real slides are 12 to 100 times over the noise, several times what neighbouring samples show.
// What exceeds the noise adds up, and what stays below takes away again (a CUSUM): rises and falls each for
// themselves. A jolt is enough of either. A slip is enough of both, for skin that slides goes to and fro and
// pressing harder is all of one sign until it ends; or 20 ms of changes beyond 75 counts, which drag the skin
// along: so do squeezes by more than 6 N/s. Of a finger that has just landed nothing is a slip. PAC is looked
// at three times a round, so jolts and slips are told up to 3.6 ms late; their onsets are exact to a sample.
//
// Units: counts, count^2; times in PAC samples of 1/2200 s, wrapping at 2^32.
#ifndef BIOTAC_EVENTS_H
#define BIOTAC_EVENTS_H

#include "touch/tare.h"

#define BT_EVENTS_LAG     8 // PAC samples
#define BT_EVENTS_NO_SLOT 0xFF

typedef struct {
    uint8_t watched; // the slot of the electrode that is; BT_EVENTS_NO_SLOT untouched
    uint8_t dragged; // samples of this vibration that changed by more than squeezes do
    bool touched;
    bool landing;   // touched, and dynamic pressure has not been quiet since
    bool jolt_told; // told of this vibration
    bool slipping;
    uint8_t samples_done;      // samples of this round
    uint32_t now;              // number of the next sample
    uint32_t round_sum_count2; // of this round
    uint32_t noise_count2;     // of a round, at rest
    uint32_t level_count2;     // twice the noise: what a change takes to be more than that
    uint32_t peak_count2;      // of one change of this vibration
    uint32_t risen_count2;     // evidence, count^2
    uint32_t fallen_count2;
    uint32_t rise_began;
    uint32_t fall_began;
    uint32_t shake_began; // either
    uint32_t slip_began;
    uint32_t slip_us; // the same as device time
    uint32_t touch_began;
    uint32_t energy_count2; // as of the latest TOUCH or LIFT
} bt_events;

void bt_events_reset(bt_events *events);

// Each after the slot's word went to the tare machine. They return events, a mask of 1 << BT_EVENT_KIND_*.
// This word fired a resting finger's trigger.
uint32_t bt_events_touch(bt_events *events, const bt_tare *tare);
// This slot is `watched`.
uint32_t bt_events_watch(bt_events *events, const bt_tare *tare);
// The first `end` PAC samples of the round are there, BT_INVALID_COUNT where no good word came; behind them
// are still those of the round before. Due three times a round: after the first BT_EVENTS_LAG, and last with
// all.
uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end);

// An event that one of them has returned, of a slot sampled at t_us: all of it but seq, finger and slot.
void bt_events_message(bt_events *events, uint8_t event, const bt_tare *tare, uint32_t t_us,
                       bt_msg_event *msg);

#endif
