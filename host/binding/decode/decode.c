#include "decode/decode.h"

#include "wire/little_endian.h"

#include <string.h>

_Static_assert(BT_FRAME_MAX_BYTES <= BT_COBS_BLOCK_BYTES, "undo_cobs() handles only one block");
_Static_assert(BT_DEFRAMED_BAD_LENGTH + 1 == BT_DECODE_OUTCOMES, "every outcome needs a counter");
// A message uses its payload, id, CRC, COBS byte and delimiter of the input, which is more than any row but a
// filled-up one needs.
_Static_assert(BT_DECODE_ROOM >= BT_DECODE_BYTES + BT_FRAME_MAX_BYTES + 1,
               "BT_DECODE_ROOM must also hold the completed rest");

#define COBS_MAX_BYTES (BT_FRAME_MAX_BYTES + 1)

void bt_decoder_reset(bt_decoder *decoder)
{
    decoder->allow_longer = 0;
    memset(decoder->outcomes, 0, sizeof decoder->outcomes);
    memset(decoder->filled, 0, sizeof decoder->filled);
    decoder->overlong = 0;
    decoder->partial_bytes = 0;
    for (int id = 0; id < 256; id++) {
        decoder->payload_bytes[id] = (int16_t)bt_wire_payload_bytes((uint8_t)id);
        decoder->kind[id] = BT_DECODED_OTHER;
    }
    decoder->kind[BT_FRAME_ID] = BT_DECODED_FRAME;
    decoder->kind[BT_PAC_ID] = BT_DECODED_PAC;
    decoder->kind[BT_IDLE_ID] = BT_DECODED_IDLE;
    bt_crc_fast_set_up(&decoder->crc);
}

// 1 <= bytes <= COBS_MAX_BYTES without a zero; plain receives one byte less. 0 if it is not COBS.
static int undo_cobs(const uint8_t *in, size_t bytes, uint8_t *plain)
{
    memcpy(plain, in + 1, bytes - 1);
    size_t at = in[0];
    for (; at < bytes; at += in[at]) {
        plain[at - 1] = 0;
    }
    return at == bytes;
}

static void append(bt_decoder *decoder, int kind, const void *bytes, size_t count)
{
    memcpy(decoder->data[kind] + decoder->filled[kind], bytes, count);
    decoder->filled[kind] += (uint32_t)count;
}

static enum bt_deframed accept(bt_decoder *decoder, uint8_t id, const uint8_t *payload, size_t bytes)
{
    int kind = decoder->kind[id];
    int expected = decoder->payload_bytes[id];
    size_t known = bytes;
    if (expected != BT_UNKNOWN_ID && bytes != (size_t)expected) {
        if (!decoder->allow_longer || bytes < (size_t)expected) {
            return BT_DEFRAMED_BAD_LENGTH;
        }
        known = (size_t)expected;
    }
    if (kind == BT_DECODED_OTHER) {
        append(decoder, kind, (uint8_t[]){id, (uint8_t)known}, 2);
    }
    append(decoder, kind, payload, known);
    append(decoder, BT_DECODED_PACKETS, (uint8_t[]){id, (uint8_t)bytes}, 2);
    append(decoder, BT_DECODED_PACKETS, payload, bytes);
    return BT_DEFRAMED_GOOD;
}

// The bytes between two delimiters.
static enum bt_deframed finish(bt_decoder *decoder, const uint8_t *in, size_t bytes)
{
    uint8_t plain[COBS_MAX_BYTES];
    if (bytes == 0) {
        return BT_DEFRAMED_NOTHING;
    }
    if (bytes > COBS_MAX_BYTES) {
        return BT_DEFRAMED_TOO_LONG;
    }
    if (!undo_cobs(in, bytes, plain)) {
        return BT_DEFRAMED_BAD_COBS;
    }
    if (bytes - 1 < 1 + BT_CRC_BYTES) {
        return BT_DEFRAMED_BAD_CRC;
    }
    size_t covered = bytes - 1 - BT_CRC_BYTES;
    if (bt_crc_fast_compute(&decoder->crc, plain, covered) != bt_get_u32(plain + covered)) {
        return BT_DEFRAMED_BAD_CRC;
    }
    return accept(decoder, plain[0], plain + 1, covered - 1);
}

// Holds only bytes that can become a frame: a delimiter may fail to come for ever.
static void add_to_partial(bt_decoder *decoder, const uint8_t *data, size_t bytes)
{
    if (decoder->overlong || decoder->partial_bytes + bytes > COBS_MAX_BYTES) {
        decoder->overlong = 1;
        return;
    }
    memcpy(decoder->partial + decoder->partial_bytes, data, bytes);
    decoder->partial_bytes = (uint16_t)(decoder->partial_bytes + bytes);
}

static enum bt_deframed finish_partial(bt_decoder *decoder, const uint8_t *data, size_t bytes)
{
    add_to_partial(decoder, data, bytes);
    enum bt_deframed outcome =
        decoder->overlong ? BT_DEFRAMED_TOO_LONG : finish(decoder, decoder->partial, decoder->partial_bytes);
    decoder->overlong = 0;
    decoder->partial_bytes = 0;
    return outcome;
}

size_t bt_decode(bt_decoder *decoder, const uint8_t *data, size_t bytes)
{
    size_t consumed = bytes < BT_DECODE_BYTES ? bytes : BT_DECODE_BYTES;
    memset(decoder->filled, 0, sizeof decoder->filled);
    const uint8_t *end = data + consumed;
    while (data < end) {
        const uint8_t *zero = memchr(data, 0, (size_t)(end - data));
        if (zero == NULL) {
            add_to_partial(decoder, data, (size_t)(end - data));
            break;
        }
        size_t piece = (size_t)(zero - data);
        int fresh = decoder->partial_bytes == 0 && !decoder->overlong;
        enum bt_deframed outcome =
            fresh ? finish(decoder, data, piece) : finish_partial(decoder, data, piece);
        decoder->outcomes[outcome]++;
        data = zero + 1;
    }
    return consumed;
}

size_t bt_decode_packets(bt_decoder *decoder, const uint8_t *packets, size_t bytes)
{
    size_t most = bytes < BT_DECODE_BYTES ? bytes : BT_DECODE_BYTES;
    size_t at = 0;
    memset(decoder->filled, 0, sizeof decoder->filled);
    while (at + 2 <= most && at + 2 + packets[at + 1] <= most) {
        decoder->outcomes[accept(decoder, packets[at], packets + at + 2, packets[at + 1])]++;
        at += 2 + (size_t)packets[at + 1];
    }
    return at;
}
