#include "decode.h"

#include "crc32.h"

#include <string.h>

_Static_assert(BT_FRAME_MAX_BYTES <= BT_COBS_BLOCK_BYTES, "undo_cobs() knows one block");
_Static_assert(BT_DEFRAMED_BAD_LENGTH + 1 == BT_DECODE_OUTCOMES, "every outcome is counted");
// A message takes its payload, id, CRC, COBS byte and delimiter from the input, more than it takes of any
// row.
_Static_assert(BT_DECODE_ROOM >= BT_DECODE_BYTES + BT_FRAME_MAX_BYTES + 1, "the rest may complete too");

#define COBS_MAX_BYTES (BT_FRAME_MAX_BYTES + 1)
#define LONG_LANE      8 // steps of eight bytes: half a FRAME
#define SHORT_LANE     3 // half a PAC

// Entry `byte`: what becomes of a CRC whose byte number `at` is that and whose others are 0 over so many
// bytes of zeros. It is linear, so that only the bits are walked.
static void fill(uint32_t table[256], int at, int zeros)
{
    table[0] = 0;
    for (uint32_t byte = 1; byte < 256; byte++) {
        uint32_t others = byte & (byte - 1);
        uint32_t crc = (byte ^ others) << (8 * at);
        for (int k = 0; k < zeros && others == 0; k++) {
            crc = bt_crc32_step(crc, 0);
        }
        table[byte] = others == 0 ? crc : table[others] ^ table[byte ^ others];
    }
}

static void set_crc_tables(bt_decoder *decoder)
{
    for (int slice = 0; slice < BT_CRC_SLICES; slice++) {
        fill(decoder->crc_slices[slice], 0, slice + 1);
    }
    for (int at = 0; at < 4; at++) {
        fill(decoder->crc_over_lane[0][at], at, 8 * SHORT_LANE);
        fill(decoder->crc_over_lane[1][at], at, 8 * LONG_LANE);
    }
}

void bt_decoder_reset(bt_decoder *decoder)
{
    decoder->allow_longer = 0;
    memset(decoder->outcomes, 0, sizeof decoder->outcomes);
    memset(decoder->filled, 0, sizeof decoder->filled);
    decoder->overlong = 0;
    decoder->rest_bytes = 0;
    for (int id = 0; id < 256; id++) {
        decoder->payload_bytes[id] = (int16_t)bt_wire_payload_bytes((uint8_t)id);
        decoder->kind[id] = BT_DECODED_OTHER;
    }
    decoder->kind[BT_FRAME_ID] = BT_DECODED_FRAME;
    decoder->kind[BT_PAC_ID] = BT_DECODED_PAC;
    decoder->kind[BT_IDLE_ID] = BT_DECODED_IDLE;
    set_crc_tables(decoder);
}

// In any byte order, and one load where that is this machine's.
static uint32_t u32_at(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static uint32_t eight_bytes(const uint32_t (*slices)[256], uint32_t crc, const uint8_t *data)
{
    uint32_t low = crc ^ u32_at(data);
    uint32_t high = u32_at(data + 4);
    return slices[7][low & 0xFF] ^ slices[6][low >> 8 & 0xFF] ^ slices[5][low >> 16 & 0xFF]
           ^ slices[4][low >> 24] ^ slices[3][high & 0xFF] ^ slices[2][high >> 8 & 0xFF]
           ^ slices[1][high >> 16 & 0xFF] ^ slices[0][high >> 24];
}

static void complement_four(uint8_t *data)
{
    for (int k = 0; k < 4; k++) {
        data[k] = (uint8_t)~data[k];
    }
}

// bt_crc32() in steps of eight bytes and, because each step waits for the one before, in two lanes: the tail
// by itself, and added when the head has been taken over as many zeros. Half of all the time goes here.
// A start of all ones is the same as none and the first four bytes complemented; without one, zeros in front
// change nothing and fill the first step. So there must be eight zeros before data.
static uint32_t crc_of(const bt_decoder *decoder, uint8_t *data, size_t bytes)
{
    if (bytes < 4) {
        return bt_crc32(data, bytes);
    }
    const uint32_t (*slices)[256] = (const uint32_t (*)[256])decoder->crc_slices;
    size_t steps = (bytes + 7) / 8;
    size_t lane = steps >= 2 * LONG_LANE ? LONG_LANE : steps >= 2 * SHORT_LANE ? SHORT_LANE : 0;
    const uint8_t *head = data + bytes - 8 * steps;
    const uint8_t *end = data + bytes - 8 * lane;
    const uint8_t *tail = end;
    uint32_t crc = 0;
    uint32_t tail_crc = 0;
    complement_four(data);
    for (size_t k = 0; k < lane; k++, head += 8, tail += 8) {
        crc = eight_bytes(slices, crc, head);
        tail_crc = eight_bytes(slices, tail_crc, tail);
    }
    for (; head < end; head += 8) {
        crc = eight_bytes(slices, crc, head);
    }
    complement_four(data);
    if (lane > 0) {
        const uint32_t (*over)[256] = (const uint32_t (*)[256])decoder->crc_over_lane[lane == LONG_LANE];
        crc = over[0][crc & 0xFF] ^ over[1][crc >> 8 & 0xFF] ^ over[2][crc >> 16 & 0xFF] ^ over[3][crc >> 24];
    }
    return bt_crc32_end(crc ^ tail_crc);
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

static void keep(bt_decoder *decoder, uint8_t id, const uint8_t *payload, size_t bytes)
{
    int kind = decoder->kind[id];
    if (kind == BT_DECODED_OTHER) {
        append(decoder, kind, (uint8_t[]){id, (uint8_t)bytes}, 2);
    }
    append(decoder, kind, payload, bytes);
    append(decoder, BT_DECODED_IDS, &id, 1);
}

// What stood between two delimiters.
static enum bt_deframed finish(bt_decoder *decoder, const uint8_t *in, size_t bytes)
{
    uint8_t zeros_and_plain[8 + COBS_MAX_BYTES];
    uint8_t *plain = zeros_and_plain + 8;
    if (bytes == 0) {
        return BT_DEFRAMED_NOTHING;
    }
    if (bytes > COBS_MAX_BYTES) {
        return BT_DEFRAMED_TOO_LONG;
    }
    memset(zeros_and_plain, 0, 8);
    if (!undo_cobs(in, bytes, plain)) {
        return BT_DEFRAMED_BAD_COBS;
    }
    if (bytes - 1 < 1 + BT_CRC_BYTES) {
        return BT_DEFRAMED_BAD_CRC;
    }
    size_t covered = bytes - 1 - BT_CRC_BYTES;
    if (crc_of(decoder, plain, covered) != u32_at(plain + covered)) {
        return BT_DEFRAMED_BAD_CRC;
    }
    int payload_bytes = (int)covered - 1;
    int expected = decoder->payload_bytes[plain[0]];
    if (expected != BT_UNKNOWN_ID && payload_bytes != expected) {
        if (!decoder->allow_longer || payload_bytes < expected) {
            return BT_DEFRAMED_BAD_LENGTH;
        }
        payload_bytes = expected;
    }
    keep(decoder, plain[0], plain + 1, (size_t)payload_bytes);
    return BT_DEFRAMED_GOOD;
}

// Never hoards what cannot become a frame: a delimiter may fail to come for ever.
static void add_to_rest(bt_decoder *decoder, const uint8_t *data, size_t bytes)
{
    if (decoder->overlong || decoder->rest_bytes + bytes > COBS_MAX_BYTES) {
        decoder->overlong = 1;
        return;
    }
    memcpy(decoder->rest + decoder->rest_bytes, data, bytes);
    decoder->rest_bytes = (uint16_t)(decoder->rest_bytes + bytes);
}

static enum bt_deframed finish_rest(bt_decoder *decoder, const uint8_t *data, size_t bytes)
{
    add_to_rest(decoder, data, bytes);
    enum bt_deframed outcome =
        decoder->overlong ? BT_DEFRAMED_TOO_LONG : finish(decoder, decoder->rest, decoder->rest_bytes);
    decoder->overlong = 0;
    decoder->rest_bytes = 0;
    return outcome;
}

size_t bt_decode_bytes(void)
{
    return BT_DECODE_BYTES;
}

size_t bt_decode(bt_decoder *decoder, const uint8_t *data, size_t bytes)
{
    size_t taken = bytes < BT_DECODE_BYTES ? bytes : BT_DECODE_BYTES;
    memset(decoder->filled, 0, sizeof decoder->filled);
    const uint8_t *end = data + taken;
    while (data < end) {
        const uint8_t *zero = memchr(data, 0, (size_t)(end - data));
        if (zero == NULL) {
            add_to_rest(decoder, data, (size_t)(end - data));
            break;
        }
        size_t piece = (size_t)(zero - data);
        int fresh = decoder->rest_bytes == 0 && !decoder->overlong;
        enum bt_deframed outcome = fresh ? finish(decoder, data, piece) : finish_rest(decoder, data, piece);
        decoder->outcomes[outcome]++;
        data = zero + 1;
    }
    return taken;
}
