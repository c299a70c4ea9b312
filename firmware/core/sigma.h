// One standard deviation of the point of contact and of the force, from the noise measured at rest.
//
// To first order, an electrode's noise moves Eq 1's centroid by w'(e) (r_i - c) / W. With independent
// noise of one size s on all electrodes that is s sqrt(sum w'^2 |r_i - c|^2) / W: numerics 2.4, for all
// weights. c is the published point, which lies on the surface: of the noise it says what a user wants to
// know, how far the point may jump, within some ten percent. The force is linear: S_d s |n_d|.
//
// Units: um and 100 uN, rounded to the nearest; saturates at 65534. 0xFFFF is not known.
#ifndef BIOTAC_SIGMA_H
#define BIOTAC_SIGMA_H

#include "kernel.h"

#ifndef BT_CDEF
static inline void bt_sigma_unknown(bt_msg_frame *msg)
{
    msg->poc_sigma_um = BT_INVALID_COUNT;
    for (int d = 0; d < 3; d++) {
        msg->force_sigma_100un[d] = BT_INVALID_COUNT;
    }
}
#endif

// e_q4 are the signals that msg's results were computed from, noise_count2 is bt_tare's.
void bt_sigma(const int32_t e_q4[BT_ELECTRODES], const bt_kernel_settings *settings, uint32_t noise_count2,
              bt_msg_frame *msg);

// Standard deviation of one electrode's counts, in 1/256 count, from the noise energy of all 19.
uint32_t bt_sigma_count_q8(uint32_t noise_count2);

#endif
