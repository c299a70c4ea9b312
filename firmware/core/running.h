// The point of contact at any moment inside a round: sums that are brought up to date electrode by
// electrode. Sums of integers do not depend on their order, so that the point has the same bits as bt_poc's
// from the same signals, for the price of the electrodes that changed.
//
// Only weights of n = 1 have sums that can be kept so: squares are shifted by the largest of them all. For
// those the point is computed anew.
#ifndef BIOTAC_RUNNING_H
#define BIOTAC_RUNNING_H

#include "fold_gen.h"
#include "poc.h"

typedef struct {
    int32_t e_q4[BT_ELECTRODES]; // what the sums hold, 1/16 count
    bt_linear_sums sums;
} bt_running;

void bt_running_reset(bt_running *running);

// The signal of one electrode is now e_q4.
void bt_running_put(bt_running *running, unsigned electrode, int32_t e_q4);

// As bt_poc.
bool bt_running_point(const bt_running *running, int weights, bt_point *point);

#endif
