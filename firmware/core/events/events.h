// Events: the finger is touched or released, is jolted, or what it holds slips.
//
// Touch and release are judged by the energy of all electrodes, each with its latest word. A resting finger's
// trigger reports the touch in the slot of the word that fires it (signal/trigger.h). On a touched finger
// only the strongest electrode is watched. When its energy falls below half the trigger's threshold, the
// energy of all electrodes is summed. If that is below half the threshold too and no pressure is left, it is
// a release; otherwise the electrode that is strongest now is watched. So the last word to fall reports the
// release.
//
// Jolts and slips are judged by dynamic pressure (PAC), by the change of the mean of four samples over eight
// (3.6 ms), at every second sample. This picks out 60 to 220 Hz, where slides shake most. What neighbouring
// samples differ by is above that; white noise and the rattle of skin that is pressed harder or less show
// there as much, slides hardly. So it raises, within 30 ms, what a change must exceed to count: however much
// a squeeze rattles, it is no slip, and a slip within the squeeze still is one.
//
// Changes above that add to the evidence and those below reduce it (a CUSUM), separately for rises and falls.
// Enough evidence in total is a jolt. Enough evidence of both rises and falls is a slip: sliding skin moves
// to and fro, while pressing harder changes PAC in one direction until it ends. Nothing is a slip on a finger
// that has just landed. PAC is examined three times a round, so jolts and slips are reported up to 3.6 ms
// late; their onsets are exact to two samples.
//
// Units: counts, count^2 of sums of four samples; times in PAC samples of 1/2200 s, wrapping at 2^32.
#ifndef BIOTAC_EVENTS_H
#define BIOTAC_EVENTS_H

#include "touch/tare.h"

#define BT_EVENTS_NO_SLOT  0xFF
#define BT_SLIP_LEVEL_NONE 0xFF // not judged
#define BT_EVENTS_APART    4    // pairs of samples, 3.6 ms
#define BT_EVENTS_PAIRS    (BT_PAC_PER_FRAME / 2)

typedef struct {
    uint8_t watched; // slot of the watched electrode; BT_EVENTS_NO_SLOT while untouched
    bool touched;
    bool landing;     // touched, and dynamic pressure has not been quiet since then
    bool jolt_raised; // a JOLT was reported for this vibration
    bool slipping;
    bool pac_valid;         // a good pair of samples came in this round
    uint8_t slip_level;     // of the latest round, as in FRAME
    uint8_t pairs_done;     // of this round's
    uint32_t now;           // number of the next sample
    uint32_t round_count2;  // squared changes of this round, each capped
    uint32_t shaken_count2; // the same in full
    uint32_t noise_count2;  // mean of round_count2 at rest
    uint32_t level_count2;  // twice the noise of one change at rest
    uint32_t rattle_count2; // mean squared difference of two neighbouring samples, over the latest 30 ms
    uint32_t peak_count2;   // largest squared change of this vibration
    uint32_t risen_count2;  // evidence
    uint32_t fallen_count2;
    uint32_t rise_began;
    uint32_t fall_began;
    uint32_t shake_began; // when either began
    uint32_t slip_began;
    uint32_t slip_us; // slip_began as device time
    uint32_t touch_began;
    uint32_t energy_count2; // at the latest TOUCH or LIFT
    uint16_t pair;          // sum of the latest two samples
    // Of the latest four, at each pair: those before, then those that have just come.
    uint16_t four[2 * BT_EVENTS_APART];
} bt_events;

void bt_events_reset(bt_events *events);

// Call these once the tare machine has taken the slot's word. They return a mask of 1 << BT_EVENT_KIND_*.
// For a word that fired a resting finger's trigger.
uint32_t bt_events_touch(bt_events *events, const bt_tare *tare);
// For the slot in `watched`.
uint32_t bt_events_watch(bt_events *events, const bt_tare *tare);
// For PAC, three times a round, last when all have come. The first `end` of pac are this round's,
// BT_INVALID_COUNT where no good word came.
uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end);

// Fill in an event that one of them returned for a slot sampled at t_us; all fields but seq, finger and slot.
void bt_events_message(bt_events *events, uint8_t event, const bt_tare *tare, uint32_t t_us,
                       bt_msg_event *msg);

#endif
