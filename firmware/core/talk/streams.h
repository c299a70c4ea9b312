// Turns rounds of slots into the messages subscribed to: FRAME, IDLE, TARE, TOUCH, EVENT, PAC and BANDS.
// Times are device time in us, wrapping at 2^32.
#ifndef BIOTAC_STREAMS_H
#define BIOTAC_STREAMS_H

#include "talk/session.h"

// A round of slots: begin, each slot's counts (BT_INVALID_COUNT where no good word came), end. Slots come in
// order; skipped ones count as missing. The end computes and sends what is subscribed to.
void bt_session_begin(bt_session *session, uint32_t t_us);
void bt_session_slot(bt_session *session, uint8_t slot, const uint16_t count[BT_MAX_FINGERS], uint32_t t_us);
void bt_session_end_round(bt_session *session);

#endif
