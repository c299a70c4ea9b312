// Frames against protocol/vectors/, which other libraries made, COBS and CRC at every address.
// protocol/conformance asks for the other vectors.
#include "fake_host.h"

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

TEST(every_case_gives_its_frames_and_counts)
{
    for (int c = 0; c < case_count; c++) {
        const framing_case *now = &cases[c];
        unsigned outcomes[6] = {0};
        bt_deframer deframer;
        bt_deframer_reset(&deframer);
        for (size_t k = 0; k < now->wire_bytes; k++) {
            enum bt_deframed outcome = bt_deframer_push(&deframer, now->wire[k]);
            int good = (int)outcomes[BT_DEFRAMED_GOOD];
            const framed *want = &now->frame[good];
            if (outcome == BT_DEFRAMED_GOOD
                && (good == now->frames || deframer.id != want->id || deframer.payload_bytes != want->bytes
                    || memcmp(deframer.buffer + 1, want->payload, want->bytes) != 0)) {
                fail_msg("%s: frame %d differs", now->name, good);
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

TEST(what_is_not_cobs_has_no_length)
{
    uint8_t out[4];
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\0", 1, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\0", 2, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\7", 1, out), -1); // what is behind it is not read
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\1\3\7", 3, out), -1);
    assert_int_equal(bt_cobs_decode((const uint8_t *)"\2\7\1", 3, out), 2);
}

TEST(chunks_of_any_size_give_the_same)
{
    static const size_t sizes[] = {1, 7, 64, MAX_WIRE};
    for (int c = 0; c < case_count; c++) {
        const framing_case *now = &cases[c];
        for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
            (void)new_session(NULL);
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

TEST(after_any_noise_one_delimiter_is_enough_to_go_on)
{
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

// Both work in words: wherever they begin and end, and nothing outside is written.
TEST(any_block_comes_back_from_any_address)
{
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
    return run_all(load_cases, NULL);
}
