// Which sensor each finger has, while connectors are loose: when one must be asked for its serial number
// again, and what follows from the answer.
//
// A finger whose words have failed for half a round may have been unplugged, and what answers next may be
// another sensor. Until its serial number has been read again, results go on as before, flagged
// SENSOR_UNSURE. With the same number nothing else happens: tare, calibration and map hold on. With another
// one the tare is forgotten; while streaming, calibration and map stay those of START, for one recording has
// one set, and where they are not the newcomer's there are no results (SENSOR_OTHER) until the stream ends.
#ifndef BIOTAC_SENSORS_H
#define BIOTAC_SENSORS_H

#include "talk/session.h"

#define BT_AWAY_WORDS (BT_SLOTS / 2) // in a row that failed: 5 ms; bus noise that long has not been seen

// This finger's serial number is not known: nobody was there at power-up.
void bt_sensors_doubt(bt_session *session, unsigned f);

// A slot's word of a finger; good: it decoded.
void bt_sensors_word(bt_session *session, unsigned f, bool good);

// After a round: bit mask of the fingers to ask for their serial number in one of the next rounds, in which
// they are not sampled (bt_session.asked).
uint8_t bt_sensors_to_ask(bt_session *session);

// What finger f answered; NULL: nothing that could be read.
void bt_sensors_answer(bt_session *session, unsigned f, const uint8_t serial[BT_SERIAL_BYTES]);

// Of FRAMEs and IDLEs: BT_FRAME_FLAG_SENSOR_*.
uint32_t bt_sensors_flags(const bt_session *session, unsigned f);

// There are no results that would be right.
bool bt_sensors_refused(const bt_session *session, unsigned f);

#endif
