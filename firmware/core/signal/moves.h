// Moves of the electrodes: sums of a window's rounds, their running means, the distances to an anchor.
//
// Units: a sum of four filtered counts is in 1/4 count (q2), a running mean in 1/16 count (q4), stepping
// down; a move has the unit of the values compared.
#ifndef BIOTAC_MOVES_H
#define BIOTAC_MOVES_H

#include "signal/trigger.h"

#define BT_WINDOW_ROUNDS 4

// Begin a window with this round's filtered counts, over the one before the last. Returns a mask of the
// electrodes that read one count in both windows and read it now.
uint32_t bt_window_begin(bt_lanes *sum, const bt_lanes *last, const bt_lanes *smooth);

// Move the means of half the lanes, from `first` on, a quarter of the way to a window's.
void bt_mean_add(bt_lanes *mean_q4, const bt_lanes *sum_q2, unsigned first);

typedef struct {
    uint32_t total; // sum of the sizes
    int32_t along;  // sum with signs
    uint32_t top;   // largest size
} bt_moves;

bt_moves bt_moves_between(const bt_lanes *now, const bt_lanes *anchor);

#endif
