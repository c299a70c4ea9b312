#include "assembly.h"

// The frame's arrays follow the channel table; a new channel must be given a place (finger.c).
_Static_assert(BT_CHANNEL_E19 - BT_CHANNEL_E1 + 1 == BT_ELECTRODES, "electrode channels must be consecutive");

void bt_frame_clear(bt_frame *frame)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        frame->electrode[i] = BT_INVALID_COUNT;
    }
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        frame->pac[k] = BT_INVALID_COUNT;
    }
    frame->pdc = BT_INVALID_COUNT;
    frame->tac = BT_INVALID_COUNT;
    frame->tdc = BT_INVALID_COUNT;
    frame->good_words = 0;
    frame->t_us = 0;
}
