// Events: the finger is touched or released, is jolted, or what it holds slips.
//
// Touch and release are judged by the energy of all electrodes, each with its latest word. A resting finger's
// trigger reports the touch in the slot of the word that fires it (signal/trigger.h). On a touched finger
// only the strongest electrode is watched. When its energy falls below half the trigger's threshold, the
// energy of all electrodes is summed. If that is below half the threshold too and no pressure is left, it is
// a release; otherwise the electrode that is strongest now is watched. So the last word to fall reports the
// release.
//
// Jolts and slips are judged by dynamic pressure (PAC), by its change over eight samples (3.6 ms). This picks
// out 70 to 200 Hz, where real slides are 12 to 100 times above the noise, several times more than
// differences of neighbouring samples show. Changes above the noise add to the evidence and those below
// reduce it (a CUSUM), separately for rises and falls. Enough evidence in total is a jolt. A slip is either
// of these:
// - Enough evidence of both rises and falls: sliding skin moves to and fro, while pressing harder changes PAC
//   in one direction until it ends.
// - Changes beyond 75 counts for 20 ms, which is skin being dragged along. Squeezing by more than 6 N/s does
//   the same.
// Nothing is a slip on a finger that has just landed. PAC is examined three times a round, so jolts and slips
// are reported up to 3.6 ms late; their onsets are exact to a sample.
//
// Units: counts, count^2; times in PAC samples of 1/2200 s, wrapping at 2^32.
#ifndef BIOTAC_EVENTS_H
#define BIOTAC_EVENTS_H

#include "touch/tare.h"

#define BT_EVENTS_LAG     8 // PAC samples
#define BT_EVENTS_NO_SLOT 0xFF

typedef struct {
    uint8_t watched; // slot of the watched electrode; BT_EVENTS_NO_SLOT while untouched
    uint8_t dragged; // samples of this vibration that changed by more than in a squeeze
    bool touched;
    bool landing;     // touched, and dynamic pressure has not been quiet since then
    bool jolt_raised; // a JOLT was reported for this vibration
    bool slipping;
    uint8_t samples_done;      // of this round's PAC samples
    uint32_t now;              // number of the next sample
    uint32_t round_sum_count2; // squared changes of this round
    uint32_t noise_count2;     // the mean of that at rest
    uint32_t level_count2;     // twice the noise of one sample; the unit of the thresholds
    uint32_t peak_count2;      // largest squared change of this vibration
    uint32_t risen_count2;     // evidence
    uint32_t fallen_count2;
    uint32_t rise_began;
    uint32_t fall_began;
    uint32_t shake_began; // when either began
    uint32_t slip_began;
    uint32_t slip_us; // slip_began as device time
    uint32_t touch_began;
    uint32_t energy_count2; // at the latest TOUCH or LIFT
} bt_events;

void bt_events_reset(bt_events *events);

// Call these once the tare machine has taken the slot's word. They return a mask of 1 << BT_EVENT_KIND_*.
// For a word that fired a resting finger's trigger.
uint32_t bt_events_touch(bt_events *events, const bt_tare *tare);
// For the slot in `watched`.
uint32_t bt_events_watch(bt_events *events, const bt_tare *tare);
// For PAC, three times a round: first when BT_EVENTS_LAG samples have come, last when all have. The first
// `end` of pac are this round's, BT_INVALID_COUNT where no good word came; the rest are still the previous
// round's.
uint32_t bt_events_pac(bt_events *events, const bt_tare *tare, const uint16_t pac[BT_PAC_PER_FRAME],
                       unsigned end);

// Fill in an event that one of them returned for a slot sampled at t_us; all fields but seq, finger and slot.
void bt_events_message(bt_events *events, uint8_t event, const bt_tare *tare, uint32_t t_us,
                       bt_msg_event *msg);

#endif
