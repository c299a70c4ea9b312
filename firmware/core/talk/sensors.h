// Tracks the sensor of each finger, as connectors may be loose: when to ask for the serial number again, and
// the effects of the answer.
//
// A finger that fails for half a round may have been unplugged, and another sensor may answer next. Until the
// serial number has been read again, results go on, flagged SENSOR_UNSURE. With the same number, tare,
// calibration and map stay valid. With another, the tare is dropped. A stream goes on with the calibration
// and map of START, because one recording has one set, and is flagged SENSOR_OTHER until it ends; there are
// no results if those do not fit the new sensor.
#ifndef BIOTAC_SENSORS_H
#define BIOTAC_SENSORS_H

#include "talk/session.h"

#define BT_AWAY_WORDS (BT_SLOTS / 2) // consecutive failed words: 5 ms; no bus noise seen lasted that long

// This finger's serial number is unknown, or may have changed.
void bt_sensors_doubt(bt_session *session, unsigned f);

// The words of a slot; BT_INVALID_COUNT where one did not decode.
void bt_sensors_slot(bt_session *session, const uint16_t count[BT_MAX_FINGERS]);

// After a round: bit mask of the fingers to ask for a serial number in one of the next rounds, without
// sampling them (bt_session.asked).
uint8_t bt_sensors_to_ask(bt_session *session);

// Finger f's answer. A number that could not be read is not reported here: the finger is asked again.
void bt_sensors_answer(bt_session *session, unsigned f, const uint8_t serial[BT_SERIAL_BYTES]);

// The BT_FRAME_FLAG_SENSOR_* of FRAMEs and IDLEs.
uint32_t bt_sensors_flags(const bt_session *session, unsigned f);

#endif
