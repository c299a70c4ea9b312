// One finger: slots in, stream messages out. Holds what belongs to that sensor alone, so that a
// fault on one finger cannot reach another.
#ifndef BIOTAC_FINGER_H
#define BIOTAC_FINGER_H

#include "assembly.h"
#include "results.h"
#include "tare.h"

// Counts of what the bus delivered; wrap at 2^32.
typedef struct {
    uint32_t good;
    uint32_t stuck;  // 0x0000 or 0xFFFF
    uint32_t error;  // 0xA5xx
    uint32_t parity; // anything else with bad parity
    uint16_t last_error_word;
} bt_word_counts;

typedef struct {
    uint8_t index;
    bool present; // the last whole frame had at least one good word
    uint16_t seq; // of the next frame; rounds in which nothing answered are not counted
    uint8_t silent_rounds;
    bool answered;  // since it was plugged in
    bt_frame frame; // being assembled
    bt_tare tare;
    bt_word_counts words;
} bt_finger;

// A quarter of a second without one good word is an unplugged sensor; less may be a bus fault or
// a late main loop, after which the tare still holds.
#define BT_UNPLUGGED_ROUNDS 25

void bt_finger_reset(bt_finger *finger, uint8_t index);

// A round of slots begins. Whatever the round before left unfilled stays marked as missing.
void bt_finger_begin(bt_finger *finger, uint32_t t_us);

// The round is over: run tare and kernels, fill the messages.
// Returns false, filling nothing, when no word of the round was good: the sensor is absent.
// tare_changed tells whether *tare holds a message to send.
bool bt_finger_finish(bt_finger *finger, const bt_kernel_settings *settings, bt_msg_frame *frame,
                      bt_msg_pac *pac, bt_msg_tare *tare, bool *tare_changed);

#endif
