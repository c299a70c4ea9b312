#include "kernel.h"

#include "fix.h"
#include "poc.h"

_Static_assert(BT_ELECTRODE_MAX_UM <= INT16_MAX, "a PoC must fit the message");

bt_kernel_settings bt_kernel_settings_from(const bt_settings *settings)
{
    int32_t force_nn[3] = {bt_settings_get(settings, BT_SETTING_FORCE_GAIN_X_NN),
                           bt_settings_get(settings, BT_SETTING_FORCE_GAIN_Y_NN),
                           bt_settings_get(settings, BT_SETTING_FORCE_GAIN_Z_NN)};
    int32_t torque_nn[2] = {bt_settings_get(settings, BT_SETTING_TORQUE_GAIN_Y_NN),
                            bt_settings_get(settings, BT_SETTING_TORQUE_GAIN_Z_NN)};
    bt_kernel_settings kernel = {
        .poc_weights = (int)bt_settings_get(settings, BT_SETTING_POC_WEIGHTS),
        .gains = bt_gains_from(force_nn, torque_nn),
        .contact_energy_count2 = (uint32_t)bt_settings_get(settings, BT_SETTING_CONTACT_ENERGY_COUNT2),
    };
    return kernel;
}

void bt_signals_q4(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                   int32_t e_q4[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool missing = counts[i] == BT_INVALID_COUNT || tare_q4[i] == BT_INVALID_COUNT;
        e_q4[i] = missing ? 0 : 16 * (int32_t)counts[i] - tare_q4[i];
    }
}

// Not initialised by a copy: the board would call memcpy for it in every frame.
static void mark_poc(int16_t poc_um[3])
{
    poc_um[0] = BT_INVALID_I16;
    poc_um[1] = BT_INVALID_I16;
    poc_um[2] = BT_INVALID_I16;
}

static void mark(int32_t result[3])
{
    result[0] = BT_INVALID_I32;
    result[1] = BT_INVALID_I32;
    result[2] = BT_INVALID_I32;
}

uint32_t bt_kernel(const int32_t e_q4[BT_ELECTRODES], const bt_kernel_settings *settings, uint32_t wanted,
                   int16_t poc_um[3], int32_t force_100un[3], int32_t torque_mnmm[3])
{
    bt_point point;
    bool asked = wanted & (BT_WANT_POC | BT_WANT_TORQUE);
    bool located = asked && bt_poc(e_q4, settings->poc_weights, &point);
    if (located && wanted & BT_WANT_POC) {
        poc_um[0] = point.um[0];
        poc_um[1] = point.um[1];
        poc_um[2] = point.um[2];
    } else {
        mark_poc(poc_um);
    }
    if (wanted & (BT_WANT_FORCE | BT_WANT_TORQUE)) {
        bt_force(e_q4, &settings->gains, force_100un);
    }
    if (wanted & BT_WANT_TORQUE) {
        bt_torque_yz(e_q4, &settings->gains, torque_mnmm + 1);
        torque_mnmm[0] = located ? bt_torque_x_derived(point.lever_yz, force_100un) : BT_INVALID_I32;
    } else {
        mark(torque_mnmm);
    }
    if (!(wanted & BT_WANT_FORCE)) {
        mark(force_100un);
    }
    return asked && !located ? BT_FRAME_FLAG_POC_INVALID : 0;
}
