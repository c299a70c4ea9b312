// What a sensor says of itself. Only while nothing is being sampled: a read takes some 0.2 ms.
#ifndef BIOTAC_PROPERTIES_H
#define BIOTAC_PROPERTIES_H

#include "wire/messages_gen.h"

// Fills info; present is 1 when the serial number begins with "BT", as SynTouch's own library
// decides it. An absent sensor reads as zeros or ones and leaves the texts zero.
void bt_properties_read(uint8_t finger, bt_msg_sensor_info *info);

#endif
