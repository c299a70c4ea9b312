// One frame's results: point of contact, force, torque and what to think of them.
// Output units are those of the FRAME message: um, 100 uN, mN*mm, rounded half away from zero;
// a result that cannot be given is the type's minimum, never 0 and never an older one.
#ifndef BIOTAC_RESULTS_H
#define BIOTAC_RESULTS_H

#include "assembly.h"
#include "settings.h"
#include "tare.h"
#include "wrench.h"

// What the kernels need of the settings, looked up once per change.
typedef struct {
    int poc_weights;
    bt_gains gains;
    uint32_t contact_energy_count2;
} bt_kernel_settings;

bt_kernel_settings bt_kernel_settings_from(const bt_settings *settings);

// Fill flags, poc_um, force_100un, torque_mnmm, tare_q4 and pdc_tare_q4 of msg.
void bt_results(const bt_frame *frame, const bt_tare *tare, const bt_kernel_settings *settings,
                bt_msg_frame *msg);

// The signals the results rest on: e = count - tare in 1/16 count; an electrode without
// a count or without a tare gives 0.
void bt_signals_q4(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                   int32_t e_q4[BT_ELECTRODES]);

// From signals to the three results and their invalid marks alone; returns POC_INVALID or 0. The
// host runs recorded counts through this same function.
uint32_t bt_kernel(const int32_t e_q4[BT_ELECTRODES], const bt_kernel_settings *settings, int16_t poc_um[3],
                   int32_t force_100un[3], int32_t torque_mnmm[3]);

#endif
