// Each finger's tare and HOLD in memory that outlives a hang or a crash, so that a grip goes on. Of two
// copies, the older is written: a reset in the middle leaves the other.
#ifndef BIOTAC_KEPT_TARES_H
#define BIOTAC_KEPT_TARES_H

#include "talk/session.h"

typedef struct {
    uint8_t serial[BT_SERIAL_BYTES]; // the sensor's; zeros: no tare
    bt_tare_kept tare;
} bt_kept_tare;

typedef struct {
    uint32_t count; // of copies written so far
    bt_kept_tare finger[BT_MAX_FINGERS];
    uint32_t crc32; // of all before
} bt_kept_copy;

typedef struct {
    bt_kept_copy copy[2];
} bt_kept_tares;

// Call after a round: stores a change, and all after half a second. rounds: the board's own, since the last
// time, 0 at first.
void bt_kept_tares_note(bt_kept_tares *kept, const bt_session *session, uint32_t *rounds);

// Call once after a hang or a crash: a finger with the same sensor gets the tare and HOLD back. True when any
// did.
bool bt_kept_tares_restore(const bt_kept_tares *kept, bt_session *session);

#endif
