// From messages to bytes on the link and back: id + payload + CRC-32, COBS, 0x00.
// protocol/SPEC.md fixes the format; protocol/vectors/ holds frames that both sides must agree on.
#ifndef BIOTAC_FRAMING_H
#define BIOTAC_FRAMING_H

#include "wire/cobs.h"
#include "wire/messages_gen.h"

#define BT_CRC_BYTES         4
#define BT_ENCODED_MAX_BYTES (BT_FRAME_MAX_BYTES + 2) // COBS and the delimiter add one each

// Make a frame in place, around a payload at out + BT_PAYLOAD_AT: id before it, CRC and delimiter after it,
// COBS over all. A board spends more time here than on the maths; with out aligned to 4 bytes it needs a
// third less. payload_bytes and the result as below.
#define BT_PAYLOAD_AT 2
size_t bt_frame_seal(uint8_t id, size_t payload_bytes, uint8_t *out);

// Write one whole frame with the delimiter to out. payload_bytes <= BT_FRAME_MAX_BYTES - 5. Returns the
// number of bytes written.
size_t bt_frame_encode(uint8_t id, const uint8_t *payload, size_t payload_bytes, uint8_t *out);

// Outcome of the bytes between two delimiters.
enum bt_deframed {
    BT_DEFRAMED_NOTHING = 0,  // frame not finished, or an empty one
    BT_DEFRAMED_GOOD = 1,     // id and payload are valid until the next push
    BT_DEFRAMED_TOO_LONG = 2, // more bytes than any frame has
    BT_DEFRAMED_BAD_COBS = 3,
    BT_DEFRAMED_BAD_CRC = 4,    // also: too short to hold an id and a CRC
    BT_DEFRAMED_BAD_LENGTH = 5, // CRC is right, but a known id has another length
};

typedef struct {
    uint16_t filled;
    uint8_t id;
    uint8_t payload_bytes;
    uint8_t buffer[BT_FRAME_MAX_BYTES + 2]; // frame, COBS code byte, and one more: full means too long
} bt_deframer;

// All zero is a valid start. The payload of a good frame begins at buffer + 1.
void bt_deframer_reset(bt_deframer *deframer);
enum bt_deframed bt_deframer_push(bt_deframer *deframer, uint8_t byte);

#endif
