// What outlives a reset: the settings, and each finger's calibration and wrench map, as records of
// board.flash.
#ifndef BIOTAC_SAVED_H
#define BIOTAC_SAVED_H

#include "talk/session.h"

// SAVE_SETTINGS: the settings, and of the rest what has changed. Returns an enum bt_error: OK, NOT_HERE, or
// NOT_STORED, and is then to be tried again.
uint8_t bt_session_save(bt_session *session);

// Once, when it is known which sensors are there. What is damaged is left out, and told as a fault.
void bt_session_load(bt_session *session);

#endif
