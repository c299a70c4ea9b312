// A round of slots: begin, each slot's counts (BT_INVALID_COUNT where no good word came), end. Slots come in
// order; skipped ones count as missing. Subscribed messages are computed and sent. Times are device time in
// us, wrapping at 2^32.
#ifndef BIOTAC_ROUNDS_H
#define BIOTAC_ROUNDS_H

#include "talk/session.h"

void bt_session_begin(bt_session *session, uint32_t t_us);
void bt_session_slot(bt_session *session, uint8_t slot, const uint16_t count[BT_MAX_FINGERS], uint32_t t_us);
void bt_session_end_round(bt_session *session);

#endif
