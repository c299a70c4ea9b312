// By how much the electrodes have moved: sums of a window's rounds, running means of these, and their
// distances from where they were anchored.
//
// Units: a sum of four filtered counts is in 1/4 count (q2), a running mean in 1/16 count (q4), its steps
// rounded down; moves are in the unit of what is compared.
#ifndef BIOTAC_MOVES_H
#define BIOTAC_MOVES_H

#include "signal/trigger.h"

#define BT_WINDOW_ROUNDS 4

// Begin a window with this round's filtered counts, in the place of the one before the last. Returns a mask
// of the electrodes that said one count in both, and say it now.
uint32_t bt_window_begin(bt_lanes *sum, const bt_lanes *last, const bt_lanes *smooth);

// Take the means of half of the lanes, from `first` on, a quarter of the way to a window's.
void bt_mean_add(bt_lanes *mean_q4, const bt_lanes *sum_q2, unsigned first);

typedef struct {
    uint32_t total; // the sum,
    int32_t along;  // with signs,
    uint32_t top;   // and the largest
} bt_moves;

bt_moves bt_moves_between(const bt_lanes *now, const bt_lanes *anchor);

#endif
