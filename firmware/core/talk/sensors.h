// Keeps track of which sensor each finger has, as connectors may be loose: when to ask for its serial number
// again, and what follows from the answer.
//
// A finger whose words have failed for half a round may have been unplugged, and the next to answer may be
// another sensor. Until its serial number has been read again, results go on as before, flagged
// SENSOR_UNSURE. If the number is the same, tare, calibration and map are kept. If it is another, the tare is
// forgotten. A stream then keeps the calibration and map of START, because one recording has one set, and is
// flagged SENSOR_OTHER until it ends; if these are not the new sensor's, there are no results.
#ifndef BIOTAC_SENSORS_H
#define BIOTAC_SENSORS_H

#include "talk/session.h"

#define BT_AWAY_WORDS (BT_SLOTS / 2) // consecutive failed words: 5 ms; no bus noise seen lasted that long

// This finger's serial number is unknown, or may have changed.
void bt_sensors_doubt(bt_session *session, unsigned f);

// The words of a slot; BT_INVALID_COUNT: it did not decode.
void bt_sensors_slot(bt_session *session, const uint16_t count[BT_MAX_FINGERS]);

// After a round: bit mask of the fingers to ask for their serial number in one of the next rounds, in which
// they are not sampled (bt_session.asked).
uint8_t bt_sensors_to_ask(bt_session *session);

// Finger f's answer. One that could not be read is none: it is asked again.
void bt_sensors_answer(bt_session *session, unsigned f, const uint8_t serial[BT_SERIAL_BYTES]);

// The BT_FRAME_FLAG_SENSOR_* of FRAMEs and IDLEs.
uint32_t bt_sensors_flags(const bt_session *session, unsigned f);

#endif
