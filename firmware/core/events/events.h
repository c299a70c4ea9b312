// Events: a finger is touched or released, is jolted, or lets an object slip.
//
// Touch and release depend on the energy of all electrodes, each with the latest word. A resting finger's
// trigger reports the touch in the slot of the word that fires it (signal/trigger.h). On a touched finger
// only the strongest electrode is compared. When its energy falls below half the trigger's threshold, the
// energy of all electrodes is added up. If that is below half the threshold too and no pressure is left, it
// is a release; otherwise the electrode that is strongest now comes next. So the last word to fall reports
// the release.
//
// Jolts and slips depend on dynamic pressure (PAC): the change of a four-sample mean over eight samples (3.6
// ms), at every second sample. This selects 60 to 220 Hz, where slides shake most. The difference of
// neighbouring samples lies above that band. White noise and the rattle of a changing press show there as
// much, slides hardly. So it raises, within 30 ms, the size from which a change counts: a squeeze that
// rattles is no slip, and a slip within the squeeze still is one.
//
// Larger changes add to the evidence, smaller ones reduce it (a CUSUM), separately for rises and falls.
// Enough evidence in total is a jolt. Enough of both rises and falls is a slip: sliding skin moves to and
// fro, while pressing harder changes PAC in one direction until it ends. A finger that has just landed does
// not slip. PAC is examined three times a round, so jolts and slips are reported up to 3.6 ms late; their
// onsets are exact to two samples.
//
// Units: counts, count^2 of sums of four samples; times in PAC samples of 1/2200 s, wrapping at 2^32.
#ifndef BIOTAC_EVENTS_H
#define BIOTAC_EVENTS_H

#include "touch/tare.h"

#define BT_EVENTS_NO_SLOT  0xFF
#define BT_SLIP_LEVEL_NONE 0xFF // unknown
#define BT_EVENTS_APART    4    // pairs of samples, 3.6 ms
#define BT_EVENTS_PAIRS    (BT_PAC_PER_FRAME / 2)

typedef struct {
    uint8_t strongest_slot; // the strongest electrode's; BT_EVENTS_NO_SLOT while untouched
    bool touched;
    bool landing;     // touched, and dynamic pressure has not been quiet since
    bool jolt_raised; // a JOLT was reported for this vibration
    bool slipping;
    bool pac_valid;         // a good pair of samples came in this round
    uint8_t slip_level;     // of the latest round, as in FRAME
    uint8_t pairs_done;     // in this round
    uint32_t now;           // number of the next sample
    uint32_t round_count2;  // squared changes of this round, each capped
    uint32_t shaken_count2; // squared changes of this round, in full
    uint32_t noise_count2;  // mean of round_count2 at rest
    uint32_t level_count2;  // twice the noise of one change at rest
    uint32_t rattle_count2; // mean squared difference of two neighbouring samples, over the latest 30 ms
    uint32_t peak_count2;   // largest squared change of this vibration
    uint32_t risen_count2;  // evidence
    uint32_t fallen_count2;
    uint32_t rise_began;
    uint32_t fall_began;
    uint32_t shake_began; // the earlier of the two
    uint32_t slip_began;
    uint32_t slip_us; // slip_began as device time
    uint32_t touch_began;
    uint32_t energy_count2; // at the latest TOUCH or LIFT
    uint16_t pair;          // sum of the latest two samples
    // Sums of the latest four samples, at each pair: those before, then the new ones.
    uint16_t four[2 * BT_EVENTS_APART];
} bt_events;

void bt_events_reset(bt_events *events);

// Call these after the tare machine has the slot's word. They return a mask of 1 << BT_EVENT_KIND_*.
// For a word that fired a resting finger's trigger.
uint32_t bt_events_touch(bt_events *events, const bt_tare *tare);
// For `strongest_slot`: whether the touch has ended.
uint32_t bt_events_lift(bt_events *events, const bt_tare *tare);
// For PAC, three times a round, last with the whole round. The first `end` words of pac are from this round,
// BT_INVALID_COUNT where no good word came.
uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end);

// Fill in an event of a slot sampled at t_us: all fields but seq, finger and slot.
void bt_events_message(bt_events *events, uint8_t event, const bt_tare *tare, uint32_t t_us,
                       bt_msg_event *msg);

#endif
