#include "assembly.h"

// The frame's arrays follow the channel table; a new channel must be given a place below.
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

void bt_frame_put(bt_frame *frame, uint8_t slot, uint16_t count)
{
    uint8_t channel = bt_slot_channel[slot];
    frame->good_words = (uint8_t)(frame->good_words + (count != BT_INVALID_COUNT));
    switch (channel) {
    case BT_CHANNEL_PAC:
        frame->pac[bt_slot_pac[slot]] = count;
        break;
    case BT_CHANNEL_PDC:
        frame->pdc = count;
        break;
    case BT_CHANNEL_TAC:
        frame->tac = count;
        break;
    case BT_CHANNEL_TDC:
        frame->tdc = count;
        break;
    default:
        if (channel >= BT_CHANNEL_E1 && channel <= BT_CHANNEL_E19) {
            frame->electrode[channel - BT_CHANNEL_E1] = count;
        }
        break;
    }
}

int bt_frame_unusable(const bt_frame *frame)
{
    int n = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        n += !bt_count_usable(frame->electrode[i]);
    }
    return n;
}
