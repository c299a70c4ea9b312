#include "finger.h"

#include <string.h>

void bt_finger_reset(bt_finger *finger, uint8_t index)
{
    memset(finger, 0, sizeof *finger);
    finger->index = index;
    bt_tare_reset(&finger->tare);
    bt_frame_clear(&finger->frame);
}

void bt_finger_begin(bt_finger *finger, uint32_t t_us)
{
    bt_frame_clear(&finger->frame);
    finger->frame.t_us = t_us;
}

static void fill_pac(const bt_finger *finger, uint16_t seq, bt_msg_pac *pac)
{
    pac->seq = seq;
    pac->t_us = finger->frame.t_us + BT_FIRST_PAC_SLOT * 1000000u / BT_SLOT_HZ;
    pac->finger = finger->index;
    memcpy(pac->pac, finger->frame.pac, sizeof pac->pac);
}

static void fill_tare(const bt_finger *finger, uint16_t seq, bt_msg_tare *msg)
{
    const bt_tare *tare = &finger->tare;
    msg->seq = seq;
    msg->t_us = finger->frame.t_us;
    msg->finger = finger->index;
    msg->tare_state = tare->state;
    msg->reason = tare->reason;
    msg->noise_count2 = tare->noise_count2;
    memcpy(msg->tare_q16, tare->base.electrode_q16, sizeof msg->tare_q16);
    msg->pdc_tare_q16 = tare->base.pdc_q16;
}

bool bt_finger_finish(bt_finger *finger, const bt_kernel_settings *settings, bt_msg_frame *frame,
                      bt_msg_pac *pac, bt_msg_tare *tare, bool *tare_changed)
{
    *tare_changed = false;
    if (finger->frame.good_words == 0) {
        finger->present = false;
        // What is plugged in next may be another sensor: the tare must not outlive this one. One that
        // the host set for a sensor that never answered yet is not this one's.
        if (finger->silent_rounds < BT_UNPLUGGED_ROUNDS && ++finger->silent_rounds == BT_UNPLUGGED_ROUNDS
            && finger->answered) {
            bt_tare_reset(&finger->tare);
            finger->answered = false;
        }
        return false;
    }
    uint16_t seq = finger->seq++;
    finger->present = true;
    finger->answered = true;
    finger->silent_rounds = 0;
    // A TARE command between two frames has changed the tare already.
    bool set_by_host = finger->tare.changed;
    bt_tare_update(&finger->tare, &finger->frame, settings->contact_energy_count2);
    finger->tare.changed = finger->tare.changed || set_by_host;
    *tare_changed = finger->tare.changed;
    if (*tare_changed) {
        fill_tare(finger, seq, tare);
    }
    frame->seq = seq;
    frame->t_us = finger->frame.t_us;
    frame->finger = finger->index;
    memcpy(frame->counts, finger->frame.electrode, sizeof frame->counts);
    frame->pdc = finger->frame.pdc;
    frame->tac = finger->frame.tac;
    frame->tdc = finger->frame.tdc;
    bt_results(&finger->frame, &finger->tare, settings, frame);
    finger->tare.changed = false;
    fill_pac(finger, seq, pac);
    return true;
}
