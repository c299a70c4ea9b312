#include "talk/faults.h"

void bt_faults_of_round(bt_session *session, unsigned f, uint32_t flags)
{
    uint32_t against = BT_TRUST_FLAGS_LATCHED;
    // Before its first tare a finger is untared in any case.
    against |= session->finger[f].tare.reason != BT_TARE_REASON_NONE ? BT_FRAME_FLAG_UNTARED : 0;
    session->status.finger_faults[f] |= flags & against;
}

void bt_faults_clear(bt_session *session, const uint8_t *payload)
{
    bt_msg_clear_faults seen;
    bt_msg_clear_faults_unpack(&seen, payload);
    session->status.faults &= (uint16_t)~seen.faults;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        session->status.finger_faults[f] &= ~seen.finger_faults[f];
    }
}
