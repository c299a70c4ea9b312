#include "decode/intake.h"

#include "decode/descriptor.h"
#include "wire/little_endian.h"
#include "wire/sensor_gen.h"

#include <string.h>

// A row needs its bytes and 16 more; it came from at least its bytes of the input.
_Static_assert(BT_PAC_BYTES >= 16 && BT_IDLE_BYTES >= 16 && BT_FRAME_BYTES >= 16,
               "twice a row's own size must suffice");
_Static_assert(BT_IDLE_BYTES > 16 && BT_FRAME_BYTES > 16, "each row may have a gap before it");
_Static_assert(BT_DECODED_FRAME == 0 && BT_DECODED_PAC == 1 && BT_DECODED_IDLE == 2, "rows come first");

#define ROUND_US   (1000000 * BT_SLOTS / BT_SLOT_HZ)
#define WRAP_US    (INT64_C(1) << 32)
#define LATEST_US  (INT64_C(1) << 62) // lies about uptime must not add up to an overflow
#define UNHEARD_US 60000000           // a board sends at least a STATUS a second; numbers wrap after 655 s

static const uint32_t row_bytes[BT_INTAKE_ROW_KINDS] = {BT_FRAME_BYTES, BT_PAC_BYTES, BT_IDLE_BYTES};

void bt_intake_reset(bt_intake *intake)
{
    memset(&intake->facts, 0, sizeof intake->facts);
    bt_decoder_reset(&intake->decoder);
    bt_numbering_reset(&intake->rounds);
    bt_numbering_reset(&intake->pacs);
    intake->t_us = (bt_unwrapper){0, 0};
    intake->uptime_s = UINT32_MAX;
    intake->status_us = 0;
    intake->unheard = 0;
}

// The three kinds of rows begin alike: u16 seq, u32 t_us, u8 finger (tests/host/wire/test_batches.py compares
// this with the schema).
static uint16_t seq_of(const uint8_t *row)
{
    return bt_get_u16(row);
}

static uint32_t t_us_of(const uint8_t *row)
{
    return bt_get_u32(row + 2);
}

static uint8_t finger_of(const uint8_t *row)
{
    return row[6];
}

static uint16_t rounds_of(int kind, const uint8_t *row)
{
    if (kind != BT_DECODED_IDLE) {
        return 1;
    }
    bt_msg_idle idle;
    bt_msg_idle_unpack(&idle, row);
    return idle.frames;
}

// The board's yes to a START, as in BT_DECODED_OTHER.
static int is_start(const uint8_t *other)
{
    if (other[0] != BT_REPLY_ID) {
        return 0;
    }
    bt_msg_reply reply;
    bt_msg_reply_unpack(&reply, other + 2);
    return reply.command == BT_START_ID && reply.error == BT_ERROR_OK;
}

// Advances device time; a long step says how long nothing was heard.
static int64_t advance_clock(bt_intake *intake, uint32_t t_us)
{
    int64_t before_us = intake->t_us.seen ? intake->t_us.last : t_us;
    int64_t now_us = bt_unwrap(&intake->t_us, t_us);
    if (now_us - before_us > UNHEARD_US) {
        intake->unheard += (now_us - before_us) / ROUND_US;
    }
    return now_us;
}

// After a silence longer than device time needs to wrap, recover the number of wraps from the board's uptime.
static void apply_status(bt_intake *intake, const bt_msg_status *status)
{
    if (status->uptime_s >= intake->uptime_s) { // else this is the first, or the board has restarted
        int64_t due_us = intake->status_us + INT64_C(1000000) * (status->uptime_s - intake->uptime_s);
        int64_t late_us = due_us - bt_unwrapped(&intake->t_us, status->t_us);
        if (late_us > WRAP_US / 2 && intake->t_us.last < LATEST_US) {
            int64_t skip_us = (late_us + WRAP_US / 2) / WRAP_US * WRAP_US;
            intake->t_us.last += skip_us;
            intake->unheard += skip_us / ROUND_US;
        }
    }
    intake->status_us = advance_clock(intake, status->t_us);
    intake->uptime_s = status->uptime_s;
}

// Message by message in the order of arrival; seq and t_us have room for the rows of their kind.
static void number(bt_intake *intake, int64_t *seq[BT_INTAKE_ROW_KINDS], int64_t *t_us[BT_INTAKE_ROW_KINDS])
{
    const bt_decoder *decoder = &intake->decoder;
    int64_t found = 0;
    int64_t last_us = INT64_MIN;
    int64_t fingers = 0;
    const uint8_t *end = decoder->data[BT_DECODED_PACKETS] + decoder->filled[BT_DECODED_PACKETS];
    for (const uint8_t *packet = decoder->data[BT_DECODED_PACKETS]; packet < end; packet += 2 + packet[1]) {
        int kind = decoder->kind[packet[0]];
        const uint8_t *row = packet + 2;
        if (kind == BT_DECODED_OTHER) {
            if (is_start(packet)) {
                // Rounds from before the START were never sent: no loss.
                bt_numbering_rejoin(&intake->rounds);
                bt_numbering_rejoin(&intake->pacs);
            }
            if (packet[0] == BT_STATUS_ID) {
                bt_msg_status status;
                bt_msg_status_unpack(&status, packet + 2);
                apply_status(intake, &status);
            }
            continue;
        }
        int64_t now_us = advance_clock(intake, t_us_of(row));
        *t_us[kind]++ = now_us;
        if (kind == BT_DECODED_PAC) {
            *seq[kind]++ = bt_number(&intake->pacs, finger_of(row), seq_of(row), 1, intake->unheard, NULL);
            continue;
        }
        bt_gap *gap = &intake->gaps[found];
        *seq[kind]++ = bt_number(&intake->rounds, finger_of(row), seq_of(row), rounds_of(kind, row),
                                 intake->unheard, gap);
        found += gap->missing > 0;
        last_us = now_us > last_us ? now_us : last_us;
        fingers |= finger_of(row) < 63 ? INT64_C(1) << finger_of(row) : -1;
    }
    intake->facts.gaps = found;
    intake->facts.last_t_us = last_us;
    intake->facts.fingers = fingers;
}

static size_t complete(bt_intake *intake, size_t consumed)
{
    bt_decoder *decoder = &intake->decoder;
    bt_intake_facts *facts = &intake->facts;
    facts->consumed = (int64_t)consumed;

    int64_t *seq[BT_INTAKE_ROW_KINDS];
    int64_t *t_us[BT_INTAKE_ROW_KINDS];
    int64_t *numbers = intake->out;
    for (int kind = 0; kind < BT_INTAKE_ROW_KINDS; kind++) {
        uint32_t rows = decoder->filled[kind] / row_bytes[kind];
        facts->rows[kind] = rows;
        seq[kind] = numbers;
        t_us[kind] = numbers + rows;
        numbers += 2 * rows;
    }
    uint8_t *at = (uint8_t *)numbers;
    for (int kind = 0; kind < BT_DECODED_KINDS; kind++) {
        memcpy(at, decoder->data[kind], decoder->filled[kind]);
        at += decoder->filled[kind];
    }
    number(intake, seq, t_us);
    facts->other_bytes = decoder->filled[BT_DECODED_OTHER];
    facts->packet_bytes = decoder->filled[BT_DECODED_PACKETS];
    facts->out_bytes = at - (uint8_t *)intake->out;
    facts->bad = 0;
    for (int outcome = BT_DEFRAMED_GOOD + 1; outcome < BT_DECODE_OUTCOMES; outcome++) {
        facts->bad += (int64_t)decoder->outcomes[outcome];
    }
    return consumed;
}

size_t bt_intake_feed(bt_intake *intake, const uint8_t *data, size_t bytes)
{
    return complete(intake, bt_decode(&intake->decoder, data, bytes));
}

size_t bt_intake_feed_packets(bt_intake *intake, const uint8_t *packets, size_t bytes)
{
    return complete(intake, bt_decode_packets(&intake->decoder, packets, bytes));
}

int64_t bt_intake_read(bt_intake *intake, int fd, double timeout_s)
{
    int64_t arrived_ns = 0;
    int64_t got = bt_descriptor_read(fd, timeout_s, intake->in, sizeof intake->in, &arrived_ns);
    if (got > 0) {
        bt_intake_feed(intake, intake->in, (size_t)got);
        intake->facts.arrived_ns = arrived_ns;
    }
    return got;
}
