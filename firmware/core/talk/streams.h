// The subscribed messages of a round: FRAME, IDLE, TARE, TOUCH, EVENT and PAC. rounds.c calls in order.
#ifndef BIOTAC_STREAMS_H
#define BIOTAC_STREAMS_H

#include "talk/session.h"

#define BT_SLOT_UNKNOWN UINT8_MAX

// A round begins: select the fingers that send EVENTs in it.
void bt_streams_begin(bt_session *session);

// After a slot: TOUCH of the fingers in `touched` (a bit mask), then EVENTs.
void bt_streams_slot(bt_session *session, uint8_t slot, uint32_t touched, uint32_t t_us);

// After a finger's round: FRAME with a TARE, or IDLE.
void bt_streams_frame(bt_session *session, bt_finger *finger);

// Then PAC.
void bt_streams_vibration(bt_session *session, bt_finger *finger);

#endif
