// Recorded words through one finger of the board, round after round, for the host.
#ifndef BIOTAC_REPLAY_H
#define BIOTAC_REPLAY_H

#include "finger.h"

// A row of results: a FRAME message as the board packs it, and the tare machine's facts about the round.
enum { BT_REPLAY_BYTES = 167 }; // compared with the Python side's row when it is imported
#define BT_REPLAY_NO_TOUCH 255  // in no slot of this round was a resting finger first touched

// words: (n, BT_SLOTS) in the board's slot order, 0..4095 or BT_INVALID_COUNT. t_us: (n,), device time of
// slot 0. rows: (n, BT_REPLAY_BYTES): the FRAME's payload, then u8 present, tare_reason, touch_slot and, in
// this machine's byte order, u32 energy_count2, noise_count2, threshold_count2. Of a round without one good
// word the board sends nothing: present is 0 and the row holds invalid marks.
// map: in force, or NULL.
void bt_replay(bt_finger *finger, const bt_settings *settings, const bt_map *map, int64_t n,
               const uint16_t *words, const uint32_t *t_us, uint8_t *rows);

// The same words for their EVENTs, a finger of its own: EVENT payloads to events (room, BT_EVENT_BYTES).
// Returns how many there were; beyond room they are counted and not written.
int64_t bt_replay_events(bt_finger *finger, const bt_settings *settings, int64_t n, const uint16_t *words,
                         const uint32_t *t_us, uint8_t *events, int64_t room);

#endif
