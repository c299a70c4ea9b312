#include "signal/round.h"

// The arrays follow the channel table; a new channel needs a place in finger.c.
_Static_assert(BT_CHANNEL_E19 - BT_CHANNEL_E1 + 1 == BT_ELECTRODES, "electrode channels must be consecutive");

void bt_round_clear(bt_round *round)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        round->electrode[i] = BT_INVALID_COUNT;
    }
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        round->pac[k] = BT_INVALID_COUNT;
    }
    round->pdc = BT_INVALID_COUNT;
    round->tac = BT_INVALID_COUNT;
    round->tdc = BT_INVALID_COUNT;
    round->good_words = 0;
    round->t_us = 0;
}
