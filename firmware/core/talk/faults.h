// Faults are kept until the host clears them, so that one that lasted a single round is not missed.
#ifndef BIOTAC_FAULTS_H
#define BIOTAC_FAULTS_H

#include "talk/session.h"

// Keep those of finger f's BT_FRAME_FLAG_* in this round that speak against its numbers.
void bt_faults_of_round(bt_session *session, unsigned f, uint32_t flags);

// CLEAR_FAULTS.
void bt_faults_clear(bt_session *session, const uint8_t *payload);

#endif
