// The host's decoder under hostile input: for any bytes in any chunks, the same messages and refusals as the
// firmware's deframer has byte by byte, and no byte read beyond a chunk.
// Input: one byte with allow_longer in bit 0, then steps. Messages are framed here, because no fuzzer
// guesses a CRC.
#include "input.h"

#include "decode/intake.h"

#include <string.h>

enum step { MESSAGE, DAMAGED, RAW, END_CHUNK, REPEAT, STEPS };

#define STREAM_BYTES 100000
#define MAX_CUTS     1000

static uint8_t stream[STREAM_BYTES];
static size_t filled;
static size_t cuts[MAX_CUTS];
static size_t cut_count;

static bt_decoder decoder;
static bt_intake intake; // the same stream, numbered
static struct {
    bt_deframer deframer;
    uint64_t outcomes[BT_DECODE_OUTCOMES];
    uint32_t filled[BT_DECODED_KINDS];
    uint8_t data[BT_DECODED_KINDS][BT_DECODE_ROOM];
} want;

static void add(const uint8_t *bytes, size_t count)
{
    if (count <= STREAM_BYTES - filled) {
        memcpy(stream + filled, bytes, count);
        filled += count;
    }
}

static void read_steps(fuzz_input *in)
{
    while (in->left > 0) {
        uint8_t step = next_u8(in) % STEPS;
        if (step == RAW) {
            size_t bytes = next_u8(in);
            bytes = bytes < in->left ? bytes : in->left;
            add(in->data, bytes);
            in->data += bytes;
            in->left -= bytes;
        } else if (step == END_CHUNK) {
            if (cut_count < MAX_CUTS) {
                cuts[cut_count++] = filled;
            }
        } else if (step == REPEAT) { // so that little input passes BT_DECODE_BYTES
            size_t bytes = 16u * next_u8(in);
            bytes = bytes < filled ? bytes : filled;
            add(stream + filled - bytes, bytes);
        } else {
            uint8_t encoded[BT_ENCODED_MAX_BYTES];
            fuzz_message message = next_message(in, step == DAMAGED, encoded);
            add(encoded, message.wire_bytes);
        }
    }
}

static void put(int kind, const void *bytes, size_t count)
{
    memcpy(want.data[kind] + want.filled[kind], bytes, count);
    want.filled[kind] += (uint32_t)count;
}

static void expect(const uint8_t *bytes, size_t count)
{
    memset(want.filled, 0, sizeof want.filled);
    for (size_t k = 0; k < count; k++) {
        enum bt_deframed outcome = bt_deframer_push(&want.deframer, bytes[k]);
        uint8_t id = want.deframer.id;
        uint8_t length = want.deframer.payload_bytes, whole = length;
        if (outcome == BT_DEFRAMED_BAD_LENGTH && decoder.allow_longer && length > bt_wire_payload_bytes(id)) {
            outcome = BT_DEFRAMED_GOOD;
            length = (uint8_t)bt_wire_payload_bytes(id);
        }
        want.outcomes[outcome]++;
        if (outcome != BT_DEFRAMED_GOOD) {
            continue;
        }
        int kind = id == BT_FRAME_ID  ? BT_DECODED_FRAME
                   : id == BT_PAC_ID  ? BT_DECODED_PAC
                   : id == BT_IDLE_ID ? BT_DECODED_IDLE
                                      : BT_DECODED_OTHER;
        if (kind == BT_DECODED_OTHER) {
            put(kind, &id, 1);
            put(kind, &length, 1);
        }
        put(kind, want.deframer.buffer + 1, length);
        put(BT_DECODED_PACKETS, &id, 1);
        put(BT_DECODED_PACKETS, &whole, 1);
        put(BT_DECODED_PACKETS, want.deframer.buffer + 1, whole);
    }
}

// The intake's rows are the decoder's, behind two numbers for each.
static void check_rows(void)
{
    const uint8_t *at = (const uint8_t *)intake.out;
    for (int k = 0; k < BT_INTAKE_ROW_KINDS; k++) {
        at += 16 * intake.facts.rows[k];
    }
    for (int kind = 0; kind < BT_DECODED_KINDS; kind++) {
        if (memcmp(at, want.data[kind], want.filled[kind]) != 0) {
            FAIL("rows of kind %d differ", kind);
        }
        at += want.filled[kind];
    }
    if (at - (const uint8_t *)intake.out != intake.facts.out_bytes) {
        FAIL("%d bytes handed out", (int)intake.facts.out_bytes);
    }
}

static void check_chunk(const uint8_t *bytes, size_t count)
{
    uint8_t *chunk = malloc(count + !count); // exactly as long, so that the sanitizer sees a read past it
    memcpy(chunk, bytes, count);
    for (size_t at = 0; at < count;) {
        size_t consumed = bt_decode(&decoder, chunk + at, count - at);
        if (consumed == 0 || consumed > count - at) {
            FAIL("of %zu bytes, %zu were taken", count - at, consumed);
        }
        expect(chunk + at, consumed);
        if (bt_intake_feed(&intake, chunk + at, consumed) != consumed) {
            FAIL("not all of %zu bytes were numbered", consumed);
        }
        check_rows();
        at += consumed;
        for (int kind = 0; kind < BT_DECODED_KINDS; kind++) {
            if (decoder.filled[kind] != want.filled[kind]
                || memcmp(decoder.data[kind], want.data[kind], want.filled[kind]) != 0) {
                FAIL("%u bytes of kind %d differ from the expected %u", decoder.filled[kind], kind,
                     want.filled[kind]);
            }
        }
        for (int k = BT_DEFRAMED_GOOD; k < BT_DECODE_OUTCOMES; k++) {
            if (decoder.outcomes[k] != want.outcomes[k]) {
                FAIL("outcome %d: counted %d times, expected %d", k, (int)decoder.outcomes[k],
                     (int)want.outcomes[k]);
            }
        }
    }
    free(chunk);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    fuzz_input in = {data, bytes};
    filled = cut_count = 0;
    memset(&want, 0, sizeof want);
    bt_decoder_reset(&decoder);
    bt_intake_reset(&intake);
    decoder.allow_longer = intake.decoder.allow_longer = next_u8(&in) & 1;
    read_steps(&in);
    size_t begin = 0;
    for (size_t k = 0; k < cut_count; k++) {
        check_chunk(stream + begin, cuts[k] - begin);
        begin = cuts[k];
    }
    check_chunk(stream + begin, filled - begin);
    return 0;
}
