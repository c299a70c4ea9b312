// One frame's results: point of contact, force, torque and what to think of them.
// Output units are those of the FRAME message: um, 100 uN, mN*mm, rounded half away from zero;
// a result that cannot be given is the type's minimum, never 0 and never an older one.
#ifndef BIOTAC_RESULTS_H
#define BIOTAC_RESULTS_H

#include "assembly.h"
#include "kernel.h"
#include "tare.h"

// Fill flags, poc_um, force_100un, torque_mnmm, tare_q4 and pdc_tare_q4 of msg.
void bt_results(const bt_frame *frame, const bt_tare *tare, const bt_kernel_settings *settings,
                bt_msg_frame *msg);

#endif
