// One standard deviation of the point of contact and of the force, from the noise measured at rest.
//
// To first order, an electrode's noise moves Eq 1's centroid m by w'(e) (r_i - m) / W. Eq 2 takes that to the
// surface: a move across the normal n grows by r / |m|, one along n vanishes. On the cylinder this applies to
// y and z, and x stays. With |m| = sum w r_i n / W and independent noise of size s on every electrode:
//
//     tip        s sqrt(sum w'^2 |r_i x n|^2) r / sum w r_i n
//     cylinder   the same in the y-z plane, and s sqrt(sum w'^2 (x_i - c_x)^2) / W along x
//
// n is c / r for the published point c. Force is linear in the signals: its sigma is S_d s |n_d|.
//
// Units: um and 100 uN, rounded to nearest; saturates at 65534. 0xFFFF: unknown.
#ifndef BIOTAC_UNCERTAINTY_H
#define BIOTAC_UNCERTAINTY_H

#include "solve/solve.h"

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
void bt_sigma(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t noise_count2,
              bt_msg_frame *msg);

// Standard deviation of one electrode's counts, in 1/256 count, from the noise energy of all 19.
uint32_t bt_sigma_count_q8(uint32_t noise_count2);

#endif
