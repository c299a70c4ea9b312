#include "wire/framing.h"

#include "wire/crc32.h"
#include "wire/little_endian.h"

#include <string.h>

// COBS then adds exactly one byte, so a frame never needs a second overhead byte.
_Static_assert(BT_FRAME_MAX_BYTES <= BT_COBS_BLOCK_BYTES, "a frame must fit one COBS block");

size_t bt_frame_seal(uint8_t id, size_t payload_bytes, uint8_t *out)
{
    uint8_t *crc_at = out + BT_PAYLOAD_AT + payload_bytes;
    out[1] = id;
    bt_put_u32(crc_at, BT_CRC32(out + 1, 1 + payload_bytes));
    crc_at[BT_CRC_BYTES] = 0;
    bt_cobs_in_place(out, (size_t)(crc_at + BT_CRC_BYTES - out));
    return (size_t)(crc_at + BT_CRC_BYTES + 1 - out);
}

size_t bt_frame_encode(uint8_t id, const uint8_t *payload, size_t payload_bytes, uint8_t *out)
{
    memcpy(out + BT_PAYLOAD_AT, payload, payload_bytes);
    return bt_frame_seal(id, payload_bytes, out);
}

void bt_deframer_reset(bt_deframer *deframer)
{
    memset(deframer, 0, sizeof *deframer);
}

static enum bt_deframed finish(bt_deframer *deframer, size_t bytes)
{
    uint8_t *buffer = deframer->buffer;
    int plain_bytes = bt_cobs_decode(buffer, bytes, buffer);
    if (plain_bytes < 0) {
        return BT_DEFRAMED_BAD_COBS;
    }
    if (plain_bytes < 1 + BT_CRC_BYTES) {
        return BT_DEFRAMED_BAD_CRC;
    }
    size_t covered = (size_t)plain_bytes - BT_CRC_BYTES;
    if (bt_get_u32(buffer + covered) != bt_crc32(buffer, covered)) {
        return BT_DEFRAMED_BAD_CRC;
    }
    deframer->id = buffer[0];
    deframer->payload_bytes = (uint8_t)(covered - 1);
    int expected = bt_wire_payload_bytes(deframer->id);
    // An unknown id passes: the sender may be newer, and the receiver can answer with an error.
    if (expected >= 0 && expected != deframer->payload_bytes) {
        return BT_DEFRAMED_BAD_LENGTH;
    }
    return BT_DEFRAMED_GOOD;
}

enum bt_deframed bt_deframer_push(bt_deframer *deframer, uint8_t byte)
{
    if (byte != 0) {
        if (deframer->filled < sizeof deframer->buffer) {
            deframer->buffer[deframer->filled++] = byte;
        }
        return BT_DEFRAMED_NOTHING;
    }
    size_t bytes = deframer->filled;
    deframer->filled = 0;
    if (bytes == 0) {
        return BT_DEFRAMED_NOTHING;
    }
    return bytes < sizeof deframer->buffer ? finish(deframer, bytes) : BT_DEFRAMED_TOO_LONG;
}
