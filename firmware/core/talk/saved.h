// Records of board.flash that outlive a reset: the settings, and each finger's calibration and wrench map.
#ifndef BIOTAC_SAVED_H
#define BIOTAC_SAVED_H

#include "talk/session.h"

// SAVE_SETTINGS: the settings, and each calibration and map that has changed. Returns an enum bt_error: OK,
// NOT_HERE, or NOT_STORED, after which the host should try again.
uint8_t bt_session_save(bt_session *session);

// Call it once, when the sensors are known. A damaged record is skipped and raises a fault.
void bt_session_load(bt_session *session);

#endif
