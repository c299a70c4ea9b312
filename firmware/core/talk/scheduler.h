// Who comes first in a round, and what is left out when time is short: wrenches, which are repeated, then
// FRAMEs.
#ifndef BIOTAC_SCHEDULER_H
#define BIOTAC_SCHEDULER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint8_t first; // first finger of a round: 0, or the first that something was left out for in the last
    uint8_t first_next; // the same, as found in this round; BT_MAX_FINGERS: none so far
} bt_scheduler;

void bt_scheduler_begin(bt_scheduler *scheduler);

// The k-th finger of this round.
uint8_t bt_scheduler_finger(const bt_scheduler *scheduler, int k);

// What to leave out of a FRAME that begins late_us after its round's last slot: a mask of enum bt_shed.
// can_repeat: the finger has a wrench to repeat.
uint32_t bt_scheduler_shed(bt_scheduler *scheduler, uint8_t finger, int32_t late_us, bool can_repeat);

void bt_scheduler_end(bt_scheduler *scheduler);

#endif
