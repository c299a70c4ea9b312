// The order of the fingers in a round, and load shedding: first wrenches, which are repeated, then FRAMEs.
#ifndef BIOTAC_SCHEDULER_H
#define BIOTAC_SCHEDULER_H

#include <stdbool.h>
#include <stdint.h>

// All zero is a valid start.
typedef struct {
    uint8_t first;       // finger of this round: 0, or the first with something shed in the last
    uint8_t first_short; // the first with something shed in this round, counted from 1; 0: none so far
} bt_scheduler;

// The k-th finger of this round.
uint8_t bt_scheduler_finger(const bt_scheduler *scheduler, int k);

// Parts to shed from a FRAME that begins late_us after the round's last slot: a mask of enum bt_shed.
// can_repeat: the finger has a wrench to repeat.
uint32_t bt_scheduler_shed(bt_scheduler *scheduler, uint8_t finger, int32_t late_us, bool can_repeat);

void bt_scheduler_end(bt_scheduler *scheduler);

#endif
