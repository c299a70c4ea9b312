// STATUS and SENSOR_STATUS messages. STATUS holds the fingers' faults until the host clears them, so that a
// fault of a single round is not missed. Times are device time in us, wrapping at 2^32.
#ifndef BIOTAC_STATUS_H
#define BIOTAC_STATUS_H

#include "talk/session.h"

void bt_session_send_status(bt_session *session, uint8_t req_id, uint32_t now_us);
void bt_session_send_sensor_status(bt_session *session, uint8_t req_id, uint8_t finger, uint32_t now_us);

// Latch those of finger f's BT_FRAME_FLAG_* in this round that speak against the numbers.
void bt_faults_of_round(bt_session *session, unsigned f, uint32_t flags);

#endif
