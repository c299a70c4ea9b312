// One frame's results: point of contact, force and torque (solve.h), and the flags that qualify them.
#ifndef BIOTAC_RESULTS_H
#define BIOTAC_RESULTS_H

#include "signal/round.h"
#include "solve/solve.h"
#include "touch/tare.h"

#define BT_ACTIVE_Q4          (15 * 16) // an electrode that moved this far is part of the contact
#define BT_ACTIVE_FOR_TORSION 4         // electrodes: with fewer there is no torsion

// Fill in flags, poc_um, force_100un, torque_mnmm, torsion_mnmm and the grip of msg. quantities is a mask of
// BT_QUANTITY_FLAG_*; all others are marked invalid.
void bt_results(const bt_round *round, const bt_tare *tare, const bt_solve_settings *settings,
                uint32_t quantities, bt_msg_frame *msg);

// The signals of a POINT, from each electrode's latest word.
void bt_point_signals(const bt_round *round, const bt_tare *tare, int32_t e_q4[BT_ELECTRODES]);

#ifndef BT_CDEF
// NOT_ASKED or 0.
static inline uint32_t bt_not_asked(uint32_t quantities)
{
    uint32_t every = BT_WANT_ALL | BT_QUANTITY_FLAG_PRESSURE;
    return (quantities & every) != every ? BT_FRAME_FLAG_NOT_ASKED : 0;
}
#endif

#endif
