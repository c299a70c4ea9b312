// Damaged frames before both deframers, the board's and the host's: every accepted message must be one that
// was sent.
//
//   damaged_frames [--frames N] [--seed S] [--kind K] [--stream]
//
// Prints a row a kind of damage: frames, reasons of refusal, frames that came through unharmed, and those
// accepted wrong. Exit 0: none accepted wrong; 1: some, and the first is printed. --stream writes N damaged
// FRAMEs to stdout instead, each tenth intact, for a check of the whole library (tools/damage, which has the
// law that their bytes follow).
#include "decode/decode.h"
#include "wire/framing.h"
#include "wire/little_endian.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum damage {
    BITS_FLIPPED,
    BURST,
    BYTE_REPLACED,
    BYTES_LOST,
    BYTES_DOUBLED,
    BYTES_SWAPPED,
    BYTES_INSERTED,
    ZERO_WITHIN,
    CUT,
    DELIMITER_LOST,
    SPLICED,
    NOISE,
    NOISE_IN_COBS,
    DAMAGES
};

static const char *const name[DAMAGES] = {
    "1 to 8 bits flipped",
    "a burst of up to 32 bits",
    "a byte replaced",
    "up to 8 bytes lost",
    "up to 8 bytes doubled",
    "two bytes swapped",
    "up to 8 bytes inserted",
    "a zero within",
    "cut off",
    "delimiter lost",
    "head of one, tail of another",
    "noise",
    "noise in good COBS",
};

#define POOL       256
#define UNIT_BYTES (2 * BT_ENCODED_MAX_BYTES + 16)

typedef struct {
    uint8_t id;
    uint8_t payload_bytes;
    uint8_t payload[BT_FRAME_MAX_BYTES];
    size_t bytes; // on the wire, with the delimiter
    uint8_t wire[BT_ENCODED_MAX_BYTES];
} sent;

typedef struct {
    uint64_t frames;
    uint64_t outcomes[BT_DECODE_OUTCOMES]; // of the host's
    uint64_t unharmed;
    uint64_t shaped; // a known id with the right length, and only the CRC was wrong
    uint64_t wrong;
} tally;

static sent pool[POOL];
static tally tallies[DAMAGES];
static bt_decoder decoder;
static bt_deframer deframer;
static uint64_t state;

static uint64_t draw(void) // splitmix64
{
    uint64_t z = state += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return z ^ z >> 31;
}

static size_t below(size_t count)
{
    return (size_t)((draw() >> 32) * count >> 32);
}

static void draw_bytes(uint8_t *out, size_t bytes)
{
    for (size_t k = 0; k < bytes; k += 8) {
        uint64_t word = draw();
        memcpy(out + k, &word, bytes - k < 8 ? bytes - k : 8);
    }
}

static void make(sent *message)
{
    int bytes;
    do {
        message->id = (uint8_t)draw();
        bytes = bt_wire_payload_bytes(message->id);
    } while (bytes < 0);
    message->payload_bytes = (uint8_t)bytes;
    draw_bytes(message->payload, message->payload_bytes);
    if (draw() & 1) { // zeros are COBS's task
        memset(message->payload + below((size_t)bytes + 1) / 2, 0, (size_t)bytes / 2);
    }
    message->bytes = bt_frame_encode(message->id, message->payload, message->payload_bytes, message->wire);
}

static void insert(uint8_t *unit, size_t *bytes, size_t at, const uint8_t *data, size_t count)
{
    memmove(unit + at + count, unit + at, *bytes - at);
    memcpy(unit + at, data, count);
    *bytes += count;
}

// unit holds one whole frame; returns how long it is then.
static size_t harm(enum damage kind, uint8_t *unit, size_t bytes, const sent *other)
{
    uint8_t some[UNIT_BYTES];
    size_t inside = bytes - 1; // but for the delimiter
    size_t at = below(inside);
    size_t run = 1 + below(8);
    run = run < inside - at ? run : inside - at;
    switch (kind) {
    case BITS_FLIPPED:
        for (size_t k = 1 + below(8); k > 0; k--) {
            size_t bit = below(8 * bytes);
            unit[bit / 8] ^= (uint8_t)(1u << bit % 8);
        }
        return bytes;
    case BURST: {
        uint64_t burst = (draw() >> 32 | 1) << below(8);
        for (size_t k = at; k < bytes && burst != 0; k++, burst >>= 8) {
            unit[k] ^= (uint8_t)burst;
        }
        return bytes;
    }
    case BYTE_REPLACED:
        unit[at] = (uint8_t)draw();
        return bytes;
    case BYTES_LOST:
        memmove(unit + at, unit + at + run, bytes - at - run);
        return bytes - run;
    case BYTES_DOUBLED:
        memcpy(some, unit + at, run);
        insert(unit, &bytes, at, some, run);
        return bytes;
    case BYTES_SWAPPED: {
        size_t with = below(inside);
        uint8_t kept = unit[at];
        unit[at] = unit[with];
        unit[with] = kept;
        return bytes;
    }
    case BYTES_INSERTED:
        draw_bytes(some, run);
        insert(unit, &bytes, at, some, run);
        return bytes;
    case ZERO_WITHIN:
        unit[at] = 0;
        return bytes;
    case CUT:
        unit[at] = 0;
        return at + 1;
    case DELIMITER_LOST:
        memcpy(unit + inside, other->wire, other->bytes);
        return inside + other->bytes;
    case SPLICED: {
        size_t from = below(other->bytes);
        memcpy(unit + at, other->wire + from, other->bytes - from);
        return at + other->bytes - from;
    }
    case NOISE:
        draw_bytes(unit, inside);
        for (size_t k = 0; k < inside; k++) {
            unit[k] = unit[k] == 0 ? 1 : unit[k];
        }
        return bytes;
    case NOISE_IN_COBS:
        draw_bytes(unit + 1, inside - 1);
        bt_cobs_in_place(unit, inside);
        return bytes;
    case DAMAGES:
        break;
    }
    return bytes;
}

static bool is(const sent *message, uint8_t id, const uint8_t *payload, size_t bytes)
{
    return id == message->id && bytes == message->payload_bytes
           && memcmp(payload, message->payload, bytes) == 0;
}

static void accuse(const char *deframer, enum damage kind, const uint8_t *unit, size_t bytes)
{
    if (tallies[kind].wrong++ == 0) {
        fprintf(stderr, "%s, accepted by the %s:", name[kind], deframer);
        for (size_t k = 0; k < bytes; k++) {
            fprintf(stderr, " %02x", unit[k]);
        }
        fputc('\n', stderr);
    }
}

// The host decoder's result, message by message.
static bool host_is_right(const sent *frame, const sent *other, uint64_t *messages)
{
    const uint8_t *at = decoder.data[BT_DECODED_PACKETS], *end = at + decoder.filled[BT_DECODED_PACKETS];
    for (; at < end; at += 2 + at[1], (*messages)++) {
        if (!is(frame, at[0], at + 2, at[1]) && !is(other, at[0], at + 2, at[1])) {
            return false;
        }
    }
    return true;
}

static void judge(enum damage kind, const uint8_t *unit, size_t bytes, const sent *frame, const sent *other)
{
    tally *entry = &tallies[kind];
    uint64_t before[BT_DECODE_OUTCOMES];
    memcpy(before, decoder.outcomes, sizeof before);
    (void)bt_decode(&decoder, unit, bytes);
    if (!host_is_right(frame, other, &entry->unharmed)) {
        accuse("host", kind, unit, bytes);
    }
    for (int k = BT_DEFRAMED_GOOD; k < BT_DECODE_OUTCOMES; k++) {
        entry->outcomes[k] += decoder.outcomes[k] - before[k];
    }
    bool crc_alone = decoder.outcomes[BT_DEFRAMED_BAD_CRC] != before[BT_DEFRAMED_BAD_CRC];
    uint8_t id = unit[0] == 1 ? 0 : unit[1];
    entry->shaped += crc_alone && bt_wire_payload_bytes(id) == (int)bytes - 2 - 1 - BT_CRC_BYTES;
    for (size_t k = 0; k < bytes; k++) {
        if (bt_deframer_push(&deframer, unit[k]) == BT_DEFRAMED_GOOD) {
            const uint8_t *payload = deframer.buffer + 1;
            if (!is(frame, deframer.id, payload, deframer.payload_bytes)
                && !is(other, deframer.id, payload, deframer.payload_bytes)) {
                accuse("board", kind, unit, bytes);
            }
        }
    }
    entry->frames++;
}

static void try_damage(uint64_t number, int only)
{
    enum damage kind = only < 0 ? (enum damage)(number % DAMAGES) : (enum damage)only;
    if (number % 8 == 0) {
        make(&pool[below(POOL)]);
    }
    const sent *frame = &pool[below(POOL)], *other = &pool[below(POOL)];
    uint8_t unit[UNIT_BYTES];
    memcpy(unit, frame->wire, frame->bytes);
    size_t bytes = harm(kind, unit, frame->bytes, other);
    if (unit[bytes - 1] != 0) { // the next one begins afresh
        unit[bytes++] = 0;
    }
    judge(kind, unit, bytes, frame, other);
}

static int report(void)
{
    tally all = {0};
    printf("%-29s %13s %11s %11s %13s %11s %11s %13s %6s\n", "damage", "frames", "too long", "COBS", "CRC",
           "length", "unharmed", "only CRC", "wrong");
    for (int k = 0; k <= DAMAGES; k++) {
        const tally *entry = k < DAMAGES ? &tallies[k] : &all;
        if (entry->frames == 0) {
            continue;
        }
        printf("%-29s %13" PRIu64, k < DAMAGES ? name[k] : "all", entry->frames);
        printf(" %11" PRIu64 " %11" PRIu64 " %13" PRIu64 " %11" PRIu64, entry->outcomes[BT_DEFRAMED_TOO_LONG],
               entry->outcomes[BT_DEFRAMED_BAD_COBS], entry->outcomes[BT_DEFRAMED_BAD_CRC],
               entry->outcomes[BT_DEFRAMED_BAD_LENGTH]);
        printf(" %11" PRIu64 " %13" PRIu64 " %6" PRIu64 "\n", entry->unharmed, entry->shaped, entry->wrong);
        if (k == DAMAGES) {
            continue;
        }
        all.frames += entry->frames;
        for (int outcome = 0; outcome < BT_DECODE_OUTCOMES; outcome++) {
            all.outcomes[outcome] += entry->outcomes[outcome];
        }
        all.unharmed += entry->unharmed;
        all.shaped += entry->shaped;
        all.wrong += entry->wrong;
    }
    return all.wrong > 0;
}

// A FRAME with bytes that follow from the number: seq, device time, finger 0, then splitmix64 from there on.
static void make_numbered(sent *message, uint32_t number)
{
    uint64_t kept = state;
    state = number;
    message->id = BT_FRAME_ID;
    message->payload_bytes = BT_FRAME_BYTES;
    draw_bytes(message->payload + 8, BT_FRAME_BYTES - 8);
    bt_put_u32(message->payload, number & 0xFFFF); // seq, and t_us over the upper half
    bt_put_u32(message->payload + 2, number * 10000u);
    message->payload[6] = message->payload[7] = 0;
    message->bytes = bt_frame_encode(message->id, message->payload, message->payload_bytes, message->wire);
    state = kept;
}

static int stream(uint64_t frames)
{
    static sent frame, other;
    for (uint32_t number = 0; number < frames + frames / 9; number++) {
        uint8_t unit[UNIT_BYTES];
        other = frame;
        make_numbered(&frame, number);
        memcpy(unit, frame.wire, frame.bytes);
        size_t bytes = frame.bytes;
        if (number % 10 != 0) {
            bytes = harm((enum damage)below(DAMAGES), unit, bytes, &other);
        }
        if (unit[bytes - 1] != 0) {
            unit[bytes++] = 0;
        }
        if (fwrite(unit, bytes, 1, stdout) != 1) {
            return 1;
        }
    }
    return fflush(stdout) != 0;
}

int main(int argc, char **argv)
{
    uint64_t frames = 1000000;
    int only = -1;
    bool streams = false;
    state = 1;
    for (int k = 1; k < argc; k++) {
        bool more = k + 1 < argc;
        if (strcmp(argv[k], "--stream") == 0) {
            streams = true;
        } else if (more && strcmp(argv[k], "--frames") == 0) {
            frames = strtoull(argv[++k], NULL, 10);
        } else if (more && strcmp(argv[k], "--seed") == 0) {
            state = strtoull(argv[++k], NULL, 10);
        } else if (more && strcmp(argv[k], "--kind") == 0) {
            only = atoi(argv[++k]) % DAMAGES;
        } else {
            fprintf(stderr, "%s: unknown, or its value is missing; see the top of damaged_frames.c\n",
                    argv[k]);
            return 2;
        }
    }
    if (streams) {
        return stream(frames);
    }
    bt_decoder_reset(&decoder);
    bt_deframer_reset(&deframer);
    for (int k = 0; k < POOL; k++) {
        make(&pool[k]);
    }
    for (uint64_t number = 0; number < frames; number++) {
        try_damage(number, only);
    }
    return report();
}
