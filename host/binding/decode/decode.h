// The link's bytes to rows of wire messages, many at once, for the host: the same outcome as
// bt_deframer_push() byte by byte.
//
// By the assertions of framing.h, a frame fits one COBS block. So COBS has put one byte in front and only
// replaced zeros, and undoing it is one copy and a walk from zero to zero.
#ifndef BIOTAC_DECODE_H
#define BIOTAC_DECODE_H

#include "decode/crc_fast.h"
#include "wire/framing.h"

enum { BT_DECODE_BYTES = 65536 };                  // the most of one call
#define BT_DECODE_ROOM     (BT_DECODE_BYTES + 512) // these, and the unused bytes of the call before
#define BT_DECODE_OUTCOMES 6                       // enum bt_deframed
#define BT_UNKNOWN_ID      (-1)

// The outputs of a call. FRAME, PAC, IDLE: payloads back to back, rows of wire.DTYPES. OTHER: u8 id, u8
// length, payload of all other messages. PACKETS: the same of every message, in order of arrival, with a
// newer peer's additions.
enum bt_decoded {
    BT_DECODED_FRAME,
    BT_DECODED_PAC,
    BT_DECODED_IDLE,
    BT_DECODED_OTHER,
    BT_DECODED_PACKETS,
    BT_DECODED_KINDS
};

typedef struct {
    uint8_t allow_longer;                  // known ids may have longer payloads; the known bytes are used
    uint64_t outcomes[BT_DECODE_OUTCOMES]; // by enum bt_deframed, since the last reset

    // The messages that the last call completed, by enum bt_decoded.
    uint32_t filled[BT_DECODED_KINDS]; // bytes
    uint8_t data[BT_DECODED_KINDS][BT_DECODE_ROOM];

    // State between calls.
    uint8_t overlong;
    uint16_t partial_bytes;
    uint8_t partial[BT_FRAME_MAX_BYTES + 2];

    // Set up by the reset, from generated tables.
    int16_t payload_bytes[256]; // by id, or BT_UNKNOWN_ID
    uint8_t kind[256];          // by id, enum bt_decoded
    bt_crc_fast crc;
} bt_decoder;

// To be called first; nothing of the struct needs a value before.
void bt_decoder_reset(bt_decoder *decoder);

// Uses at most BT_DECODE_BYTES and returns how many. The messages of the call before are gone.
size_t bt_decode(bt_decoder *decoder, const uint8_t *data, size_t bytes);

// The same of packets that were decoded before: whole ones, at most BT_DECODE_BYTES.
size_t bt_decode_packets(bt_decoder *decoder, const uint8_t *packets, size_t bytes);

#endif
