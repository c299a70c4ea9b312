#include "results.h"

#include "fix.h"

#define ACTIVE_Q4          (15 * 16) // an electrode that moved this far takes part in the contact
#define ACTIVE_FOR_TORSION 4
#define BASE_OLD_FRAMES    (60000 / BT_FRAME_MS) // one minute

static void invalidate(int16_t poc_um[3], int32_t force_100un[3], int32_t torque_mnmm[3])
{
    for (int d = 0; d < 3; d++) {
        poc_um[d] = BT_INVALID_I16;
        force_100un[d] = BT_INVALID_I32;
        torque_mnmm[d] = BT_INVALID_I32;
    }
}

typedef struct {
    uint64_t energy; // count^2
    uint64_t bulge;  // count^2 of electrodes that gained
    int active;
} signal_shape;

static signal_shape shape_of(const int32_t e_q4[BT_ELECTRODES])
{
    signal_shape shape = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t square_q8 = bt_abs32(e_q4[i]) * bt_abs32(e_q4[i]); // below 2^32: |e| is below 2^16
        shape.energy += square_q8;
        shape.bulge += e_q4[i] > 0 ? square_q8 : 0;
        shape.active += bt_abs32(e_q4[i]) >= ACTIVE_Q4;
    }
    shape.energy >>= 8;
    shape.bulge >>= 8;
    return shape;
}

static uint32_t channel_flags(const bt_frame *frame)
{
    uint32_t flags = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool missing = frame->electrode[i] == BT_INVALID_COUNT;
        bool railed = bt_count_railed(frame->electrode[i]);
        flags |= missing ? BT_FRAME_FLAG_ELECTRODE_MISSING : 0;
        flags |= railed ? BT_FRAME_FLAG_RAIL : 0;
    }
    flags |= bt_frame_unusable(frame) > BT_USABLE_WITHOUT ? BT_FRAME_FLAG_FAULT : 0;
    flags |= frame->pdc == BT_INVALID_COUNT ? BT_FRAME_FLAG_PDC_MISSING : 0;
    flags |= frame->tac == BT_INVALID_COUNT ? BT_FRAME_FLAG_TAC_MISSING : 0;
    flags |= frame->tdc == BT_INVALID_COUNT ? BT_FRAME_FLAG_TDC_MISSING : 0;
    return flags;
}

// The PoC's outward normal is within 60 degrees of -z: c_z <= -r/2, on tip and cylinder alike.
static bool faces_down(const int16_t poc_um[3])
{
    return poc_um[2] <= -BT_CORE_RADIUS_UM / 2;
}

void bt_results(const bt_frame *frame, const bt_tare *tare, const bt_kernel_settings *settings,
                bt_msg_frame *msg)
{
    msg->flags = channel_flags(frame) | BT_FRAME_FLAG_MX_DERIVED | BT_FRAME_FLAG_FX_WEAK;
    msg->tare_state = tare->state;
    msg->flags |= tare->changed ? BT_FRAME_FLAG_TARE_CHANGED : 0;
    msg->pdc_tare_q4 = bt_tare_q4(tare->base.pdc_q16);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        msg->tare_q4[i] = bt_tare_q4(tare->base.electrode_q16[i]);
    }
    if (tare->reason == BT_TARE_REASON_NONE) {
        msg->flags |= BT_FRAME_FLAG_UNTARED | BT_FRAME_FLAG_POC_INVALID;
        invalidate(msg->poc_um, msg->force_100un, msg->torque_mnmm);
        return;
    }
    int32_t e_q4[BT_ELECTRODES];
    bt_signals_q4(frame->electrode, msg->tare_q4, e_q4);
    msg->flags |= bt_kernel(e_q4, settings, BT_WANT_ALL, msg->poc_um, msg->force_100un, msg->torque_mnmm);

    uint32_t threshold = bt_tare_threshold_count2(tare, settings->contact_energy_count2);
    signal_shape shape = shape_of(e_q4);
    bool has_poc = !(msg->flags & BT_FRAME_FLAG_POC_INVALID);
    bool complete = !(msg->flags & (BT_FRAME_FLAG_ELECTRODE_MISSING | BT_FRAME_FLAG_RAIL));
    bool torsion_ok = has_poc && complete && faces_down(msg->poc_um) && shape.energy > threshold
                      && shape.active >= ACTIVE_FOR_TORSION;
    msg->flags |= tare->state == BT_TARE_STATE_CONTACT ? BT_FRAME_FLAG_CONTACT : 0;
    msg->flags |= shape.energy < 4 * (uint64_t)threshold ? BT_FRAME_FLAG_POC_LOW : 0;
    msg->flags |= shape.bulge > shape.energy - shape.bulge ? BT_FRAME_FLAG_SHEAR_MIX : 0;
    msg->flags |= torsion_ok ? BT_FRAME_FLAG_TORSION_OK : 0;
    msg->flags |= tare->contact_frames > BASE_OLD_FRAMES ? BT_FRAME_FLAG_BASE_OLD : 0;
}
