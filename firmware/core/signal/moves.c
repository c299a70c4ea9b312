#include "signal/moves.h"

#include "fixed_point.h"

_Static_assert(BT_WINDOW_ROUNDS *BT_TRIGGER_UNREAD <= UINT16_MAX, "a sum must fit its half of a pair");

uint32_t bt_window_begin(bt_lanes *sum, const bt_lanes *last, const bt_lanes *smooth)
{
    uint32_t same = 0;
    for (unsigned k = 0; k < BT_LANES / 2; k++) {
        uint32_t words = smooth->pair[k];
        uint32_t differ = (sum->pair[k] ^ last->pair[k]) | (last->pair[k] ^ words * BT_WINDOW_ROUNDS);
        sum->pair[k] = words;
        same |= (differ & 0xFFFF) == 0 ? 1u << 2 * k : 0;
        same |= differ >> 16 == 0 ? 2u << 2 * k : 0;
    }
    return same & BT_ALL_ELECTRODES;
}

void bt_mean_add(bt_lanes *mean_q4, const bt_lanes *sum_q2, unsigned first)
{
    for (unsigned k = first / 2; k < first / 2 + BT_LANES / 4; k++) {
        mean_q4->pair[k] += sum_q2->pair[k] - (mean_q4->pair[k] >> 2 & 0x3FFF3FFF);
    }
}

bt_moves bt_moves_between(const bt_lanes *now, const bt_lanes *anchor)
{
    bt_moves sum = {0};
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t move = now->lane[i] - anchor->lane[i];
        uint32_t size = bt_abs32(move);
        sum.total += size;
        sum.along += move;
        sum.top = size > sum.top ? size : sum.top;
    }
    return sum;
}
