// STATUS and SENSOR_STATUS messages. Times are device time in us, wrapping at 2^32.
#ifndef BIOTAC_STATUS_H
#define BIOTAC_STATUS_H

#include "talk/session.h"

void bt_session_send_status(bt_session *session, uint8_t req_id, uint32_t now_us);
void bt_session_send_sensor_status(bt_session *session, uint8_t req_id, uint8_t finger, uint32_t now_us);

#endif
