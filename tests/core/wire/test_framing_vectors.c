// Frames, COBS and CRC against protocol/vectors/, which other libraries made.
#include "support.h"

#include "talk/host_link.h"
#include "talk/rounds.h"
#include "wire/crc32.h"
#include "wire/framing.h"

#define MAX_CASES  64
#define MAX_FRAMES 64
#define MAX_WIRE   4096

typedef struct {
    uint8_t id;
    size_t bytes;
    uint8_t payload[BT_FRAME_MAX_BYTES];
} framed;

typedef struct {
    char name[80];
    uint8_t wire[MAX_WIRE];
    size_t wire_bytes;
    framed frame[MAX_FRAMES];
    int frames;
    unsigned too_long, bad_cobs, bad_crc, bad_length;
} framing_case;

static framing_case cases[MAX_CASES];
static int case_count;

static int load_cases(void **state)
{
    (void)state;
    char line[LINE_BYTES];
    char hex[LINE_BYTES];
    unsigned id;
    FILE *file = open_vectors("framing.txt");
    framing_case *now = cases;
    while (next_line(file, line)) {
        if (sscanf(line, "case %79s", now->name) == 1) {
            continue;
        }
        if (sscanf(line, "wire %4095s", hex) == 1) {
            now->wire_bytes += bytes_from_hex(hex, now->wire + now->wire_bytes, MAX_WIRE - now->wire_bytes);
        } else if (sscanf(line, "frame %2x %4095s", &id, hex) == 2) {
            assert_true(now->frames < MAX_FRAMES);
            framed *frame = &now->frame[now->frames++];
            frame->id = (uint8_t)id;
            frame->bytes = bytes_from_hex(hex, frame->payload, sizeof frame->payload);
        } else {
            assert_int_equal(sscanf(line, "counts %u %u %u %u", &now->too_long, &now->bad_cobs, &now->bad_crc,
                                    &now->bad_length),
                             4);
            assert_true(++case_count < MAX_CASES);
            now++;
        }
    }
    assert_true(case_count >= 40);
    return 0;
}

static void every_case_gives_its_frames_and_counts(void **state)
{
    (void)state;
    for (int c = 0; c < case_count; c++) {
        const framing_case *now = &cases[c];
        unsigned outcomes[6] = {0};
        bt_deframer deframer;
        bt_deframer_reset(&deframer);
        for (size_t k = 0; k < now->wire_bytes; k++) {
            enum bt_deframed outcome = bt_deframer_push(&deframer, now->wire[k]);
            if (outcome == BT_DEFRAMED_GOOD) {
                if ((int)outcomes[BT_DEFRAMED_GOOD] >= now->frames) {
                    fail_msg("%s: accepts more than %d frames", now->name, now->frames);
                }
                const framed *want = &now->frame[outcomes[BT_DEFRAMED_GOOD]];
                if (deframer.id != want->id || deframer.payload_bytes != want->bytes
                    || memcmp(deframer.buffer + 1, want->payload, want->bytes) != 0) {
                    fail_msg("%s: frame %u differs", now->name, outcomes[BT_DEFRAMED_GOOD]);
                }
            }
            outcomes[outcome]++;
        }
        if ((int)outcomes[BT_DEFRAMED_GOOD] != now->frames || outcomes[BT_DEFRAMED_TOO_LONG] != now->too_long
            || outcomes[BT_DEFRAMED_BAD_COBS] != now->bad_cobs
            || outcomes[BT_DEFRAMED_BAD_CRC] != now->bad_crc
            || outcomes[BT_DEFRAMED_BAD_LENGTH] != now->bad_length) {
            fail_msg("%s: good %u, too long %u, bad COBS %u, bad CRC %u, bad length %u", now->name,
                     outcomes[BT_DEFRAMED_GOOD], outcomes[BT_DEFRAMED_TOO_LONG],
                     outcomes[BT_DEFRAMED_BAD_COBS], outcomes[BT_DEFRAMED_BAD_CRC],
                     outcomes[BT_DEFRAMED_BAD_LENGTH]);
        }
    }
}

static void one_deframer_carries_nothing_from_one_case_into_the_next(void **state)
{
    (void)state;
    bt_deframer deframer;
    bt_deframer_reset(&deframer);
    for (int c = 0; c < 3 * case_count; c++) {
        const framing_case *now = &cases[c * 7 % case_count]; // another order than the file's
        int good = 0;
        (void)bt_deframer_push(&deframer, 0); // ends what the case before left unfinished
        for (size_t k = 0; k < now->wire_bytes; k++) {
            good += bt_deframer_push(&deframer, now->wire[k]) == BT_DEFRAMED_GOOD;
        }
        assert_int_equal(good, now->frames);
    }
}

static void what_is_not_cobs_has_no_length(void **state)
{
    (void)state;
    uint8_t out[4];
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\0", 1, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\0", 2, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\1\3\7", 3, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\7\1", 3, out), 2);
}

static bool discard(void *context, unsigned link, const uint8_t *data, size_t bytes)
{
    (void)link;
    (void)context;
    (void)data;
    (void)bytes;
    return true;
}

static void chunks_of_any_size_give_the_same(void **state)
{
    (void)state;
    static const size_t sizes[] = {1, 2, 3, 5, 7, 13, 63, 64, 65, 255, MAX_WIRE};
    static const bt_identity identity;
    static bt_session session;
    for (int c = 0; c < case_count; c++) {
        const framing_case *now = &cases[c];
        for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
            bt_session_init(&session, &identity, discard, NULL, 0);
            for (size_t at = 0; at < now->wire_bytes; at += sizes[s]) {
                size_t rest = now->wire_bytes - at;
                // A copy of exactly the chunk: the sanitizer sees a read beyond it.
                size_t bytes = rest < sizes[s] ? rest : sizes[s];
                uint8_t *chunk = malloc(bytes);
                memcpy(chunk, now->wire + at, bytes);
                bt_session_receive(&session, 0, chunk, bytes, 0);
                free(chunk);
            }
            assert_int_equal(session.rx_frames, now->frames);
            assert_int_equal(session.rx_errors,
                             now->too_long + now->bad_cobs + now->bad_crc + now->bad_length);
        }
    }
}

static void every_accepted_frame_is_encoded_to_the_bytes_it_came_in(void **state)
{
    (void)state;
    for (int c = 0; c < case_count; c++) {
        const framing_case *now = &cases[c];
        size_t at = 0; // frames come in order, with other bytes between them
        for (int f = 0; f < now->frames; f++) {
            uint8_t encoded[BT_ENCODED_MAX_BYTES];
            const framed *frame = &now->frame[f];
            size_t bytes = bt_frame_encode(frame->id, frame->payload, frame->bytes, encoded);
            while (at + bytes <= now->wire_bytes && memcmp(now->wire + at, encoded, bytes) != 0) {
                at++;
            }
            if (at + bytes > now->wire_bytes) {
                fail_msg("%s: frame %d is encoded to other bytes", now->name, f);
            }
            at += bytes;
        }
    }
}

static void no_flipped_bit_is_accepted(void **state)
{
    (void)state;
    const framing_case *now = &cases[0]; // every message once
    for (int f = 0; f < now->frames; f++) {
        uint8_t encoded[BT_ENCODED_MAX_BYTES];
        size_t bytes = bt_frame_encode(now->frame[f].id, now->frame[f].payload, now->frame[f].bytes, encoded);
        for (size_t bit = 0; bit < 8 * (bytes - 1); bit++) {
            bt_deframer deframer;
            bt_deframer_reset(&deframer);
            encoded[bit / 8] ^= (uint8_t)(1u << bit % 8);
            for (size_t k = 0; k < bytes; k++) {
                assert_int_not_equal(bt_deframer_push(&deframer, encoded[k]), BT_DEFRAMED_GOOD);
            }
            encoded[bit / 8] ^= (uint8_t)(1u << bit % 8);
        }
    }
}

static void after_any_noise_one_delimiter_is_enough_to_go_on(void **state)
{
    (void)state;
    uint64_t seed = 1;
    bt_deframer deframer;
    bt_deframer_reset(&deframer);
    for (int run = 0; run < 20000; run++) {
        int64_t noise = random_range(&seed, 0, 600);
        uint8_t encoded[BT_ENCODED_MAX_BYTES];
        uint8_t req_id = (uint8_t)run;
        for (int64_t k = 0; k < noise; k++) {
            // small bytes too: they are COBS codes that fit
            int64_t top = run % 2 ? 255 : 9;
            assert_int_not_equal(bt_deframer_push(&deframer, (uint8_t)random_range(&seed, 0, top)),
                                 BT_DEFRAMED_GOOD);
        }
        (void)bt_deframer_push(&deframer, 0);
        size_t bytes = bt_frame_encode(BT_PING_ID, &req_id, 1, encoded);
        for (size_t k = 0; k + 1 < bytes; k++) {
            assert_int_equal(bt_deframer_push(&deframer, encoded[k]), BT_DEFRAMED_NOTHING);
        }
        assert_int_equal(bt_deframer_push(&deframer, 0), BT_DEFRAMED_GOOD);
        assert_int_equal(deframer.buffer[1], req_id);
    }
}

static void cobs_examples_hold_in_both_directions(void **state)
{
    (void)state;
    char line[LINE_BYTES], first[LINE_BYTES], second[LINE_BYTES];
    int good = 0, written = 0, bad = 0;
    FILE *file = open_vectors("cobs.txt");
    while (next_line(file, line)) {
        uint8_t plain[1024], encoded[1024], out[1024];
        if (sscanf(line, "good %4095s %4095s", first, second) == 2) {
            size_t plain_bytes = bytes_from_hex(first, plain, sizeof plain);
            size_t encoded_bytes = bytes_from_hex(second, encoded, sizeof encoded);
            if (plain_bytes <= BT_COBS_BLOCK_BYTES) {
                assert_int_equal(encoded_bytes, plain_bytes + 1);
                for (size_t offset = 0; offset < 4; offset++) { // wherever words begin
                    memcpy(out + offset + 1, plain, plain_bytes);
                    bt_cobs_in_place(out + offset, encoded_bytes);
                    assert_memory_equal(out + offset, encoded, encoded_bytes);
                }
                written++;
            }
            assert_int_equal(bt_cobs_decode(encoded, encoded_bytes, encoded), plain_bytes); // in place
            assert_memory_equal(encoded, plain, plain_bytes);
            good++;
        } else {
            assert_int_equal(sscanf(line, "bad %4095s", first), 1);
            size_t encoded_bytes = bytes_from_hex(first, encoded, sizeof encoded);
            assert_int_equal(bt_cobs_decode(encoded, encoded_bytes, out), -1);
            bad++;
        }
    }
    assert_true(good >= 12 && written >= 8 && bad >= 5);
}

static void crc32_known_answers_hold(void **state)
{
    (void)state;
    char line[LINE_BYTES], hex[LINE_BYTES];
    unsigned crc;
    int n = 0;
    FILE *file = open_vectors("crc32.txt");
    while (next_line(file, line)) {
        uint8_t data[512];
        assert_int_equal(sscanf(line, "%8x %4095s", &crc, hex), 2);
        assert_int_equal(bt_crc32(data, bytes_from_hex(hex, data, sizeof data)), crc);
        n++;
    }
    assert_true(n >= 5);
    assert_int_equal(bt_crc32((const uint8_t *)"123456789", 9), 0xCBF43926);
}

// Both work in words: wherever they begin and end, and nothing outside is written.
static void any_block_comes_back_from_any_address(void **state)
{
    (void)state;
    uint64_t seed = 21;
    for (int run = 0; run < 20000; run++) {
        uint8_t room[BT_COBS_BLOCK_BYTES + 16], plain[BT_COBS_BLOCK_BYTES], back[BT_COBS_BLOCK_BYTES + 1];
        size_t bytes = (size_t)random_range(&seed, 0, run % 4 ? 24 : BT_COBS_BLOCK_BYTES);
        uint8_t *block = room + 4 + random_range(&seed, 0, 3);
        int64_t top = run % 3 ? 255 : 1; // a 1 above a 0 is what looks like a zero to has_zero
        memset(room, 0xA5, sizeof room);
        for (size_t k = 0; k < bytes; k++) {
            block[1 + k] = plain[k] = (uint8_t)random_range(&seed, 0, top);
        }
        uint32_t crc = 0xFFFFFFFFu;
        for (size_t k = 0; k < 8 * bytes; k++) {
            crc = crc >> 1 ^ (0xEDB88320u & (0u - ((crc ^ (uint32_t)plain[k / 8] >> k % 8) & 1)));
        }
        assert_int_equal(bt_crc32(block + 1, bytes), ~crc);
        bt_cobs_in_place(block, bytes + 1);
        assert_true(memchr(block, 0, bytes + 1) == NULL);
        assert_int_equal(bt_cobs_decode(block, bytes + 1, back), bytes);
        assert_memory_equal(back, plain, bytes);
        assert_int_equal(block[-1], 0xA5);
        assert_int_equal(block[bytes + 1], 0xA5);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_case_gives_its_frames_and_counts),
        cmocka_unit_test(one_deframer_carries_nothing_from_one_case_into_the_next),
        cmocka_unit_test(chunks_of_any_size_give_the_same),
        cmocka_unit_test(every_accepted_frame_is_encoded_to_the_bytes_it_came_in),
        cmocka_unit_test(no_flipped_bit_is_accepted),
        cmocka_unit_test(after_any_noise_one_delimiter_is_enough_to_go_on),
        cmocka_unit_test(cobs_examples_hold_in_both_directions),
        cmocka_unit_test(what_is_not_cobs_has_no_length),
        cmocka_unit_test(crc32_known_answers_hold),
        cmocka_unit_test(any_block_comes_back_from_any_address),
    };
    return cmocka_run_group_tests(tests, load_cases, NULL);
}
