#include "framing.h"

#include "crc32.h"

#include <string.h>

// COBS then adds exactly one byte, so a frame never needs a second overhead byte.
_Static_assert(BT_FRAME_MAX_BYTES <= 254, "a frame must fit one COBS block");

size_t bt_frame_encode(uint8_t id, const uint8_t *payload, size_t payload_bytes, uint8_t *out)
{
    uint8_t plain[BT_FRAME_MAX_BYTES];
    plain[0] = id;
    memcpy(plain + 1, payload, payload_bytes);
    size_t bytes = 1 + payload_bytes;
    uint32_t crc = bt_crc32(plain, bytes);
    for (int k = 0; k < BT_CRC_BYTES; k++) {
        plain[bytes++] = (uint8_t)(crc >> (8 * k));
    }
    size_t encoded = bt_cobs_encode(plain, bytes, out);
    out[encoded++] = 0;
    return encoded;
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
    uint32_t crc = bt_crc32(buffer, covered);
    for (size_t k = 0; k < BT_CRC_BYTES; k++) {
        if (buffer[covered + k] != (uint8_t)(crc >> (8 * k))) {
            return BT_DEFRAMED_BAD_CRC;
        }
    }
    deframer->id = buffer[0];
    deframer->payload_bytes = (uint8_t)(covered - 1);
    int expected = bt_wire_payload_bytes(deframer->id);
    // An unknown id passes: it may be a newer peer's, and its receiver can answer in words.
    if (expected >= 0 && expected != deframer->payload_bytes) {
        return BT_DEFRAMED_BAD_LENGTH;
    }
    return BT_DEFRAMED_GOOD;
}

enum bt_deframed bt_deframer_push(bt_deframer *deframer, uint8_t byte)
{
    if (byte != 0) {
        if (deframer->filled < BT_FRAME_MAX_BYTES + 1) {
            deframer->buffer[deframer->filled++] = byte;
        } else {
            deframer->too_long = 1;
        }
        return BT_DEFRAMED_NOTHING;
    }
    size_t bytes = deframer->filled;
    int too_long = deframer->too_long;
    deframer->filled = 0;
    deframer->too_long = 0;
    if (too_long) {
        return BT_DEFRAMED_TOO_LONG;
    }
    if (bytes == 0) {
        return BT_DEFRAMED_NOTHING;
    }
    return finish(deframer, bytes);
}
