#include "talk/faults.h"

// Without DOUBT and OUTSIDE, which even the best finger has at the beginning and the end of a touch.
#define AGAINST_ITS_NUMBERS                                                                                  \
    (BT_FRAME_FLAG_ELECTRODE_MISSING | BT_FRAME_FLAG_RAIL | BT_FRAME_FLAG_PDC_MISSING                        \
     | BT_FRAME_FLAG_TAC_MISSING | BT_FRAME_FLAG_TDC_MISSING | BT_FRAME_FLAG_BASE_OLD | BT_FRAME_FLAG_FAULT  \
     | BT_FRAME_FLAG_TEMP | BT_FRAME_FLAG_REPEATED | BT_FRAME_FLAG_SHED | BT_FRAME_FLAG_SENSOR_UNSURE        \
     | BT_FRAME_FLAG_SENSOR_OTHER | BT_FRAME_FLAG_PDC_FLAT | BT_FRAME_FLAG_ELECTRODE_OUT                     \
     | BT_FRAME_FLAG_SENSOR_FAULT)

void bt_faults_of_round(bt_session *session, unsigned f, uint32_t flags)
{
    uint32_t against = AGAINST_ITS_NUMBERS;
    // Before its first tare a finger is untared in any case.
    against |= session->finger[f].tare.reason != BT_TARE_REASON_NONE ? BT_FRAME_FLAG_UNTARED : 0;
    session->finger_faults[f] |= flags & against;
}

void bt_faults_clear(bt_session *session, const uint8_t *payload)
{
    bt_msg_clear_faults seen;
    bt_msg_clear_faults_unpack(&seen, payload);
    session->faults &= (uint16_t)~seen.faults;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        session->finger_faults[f] &= ~seen.finger_faults[f];
    }
}
