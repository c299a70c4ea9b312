// What went wrong, kept until the host clears it: a fault of one round is not missed by who looks now and
// then.
#ifndef BIOTAC_FAULTS_H
#define BIOTAC_FAULTS_H

#include "talk/session.h"

// Finger f's round carries these BT_FRAME_FLAG_*; those that speak against its numbers are kept.
void bt_faults_of_round(bt_session *session, unsigned f, uint32_t flags);

// CLEAR_FAULTS.
void bt_faults_clear(bt_session *session, const uint8_t *payload);

#endif
