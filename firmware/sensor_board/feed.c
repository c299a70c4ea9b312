#include "feed.h"

const bt_msg_hello bt_emu_hello = {
    .board = BT_BOARD_PICO_SENSOR,
    .fingers = BT_MAX_FINGERS,
    .board_name = "simulated",
    .board_serial = "simulated",
    .slot_hz = BT_SLOT_HZ,
};

static void send_message(const bt_emu_feed *feed, uint8_t id, const uint8_t *payload, size_t bytes)
{
    uint8_t frame[BT_ENCODED_MAX_BYTES];
    feed->send(frame, bt_frame_encode(id, payload, bytes, frame));
}

static void send_hello(const bt_emu_feed *feed)
{
    uint8_t payload[BT_HELLO_BYTES];
    bt_msg_hello hello = *feed->hello;
    hello.req_id = feed->got.hello.req_id;
    hello.nonce = feed->got.hello.nonce;
    hello.wire_major = BT_WIRE_MAJOR;
    hello.wire_minor = BT_WIRE_MINOR;
    hello.schema_hash = BT_SCHEMA_HASH;
    bt_msg_hello_pack(&hello, payload);
    send_message(feed, BT_HELLO_ID, payload, sizeof payload);
}

static void send_status(const bt_emu_feed *feed, uint8_t req_id)
{
    const bt_emu_stream *stream = feed->stream;
    const uint32_t room = bt_emu_stream_room(stream);
    uint8_t payload[BT_EMU_STATUS_BYTES];
    bt_msg_emu_status status = {
        .req_id = req_id,
        .fingers = (uint8_t)((1u << stream->fingers) - 1),
        .slots_taken = stream->written,
        .room_slots = (uint16_t)(room < UINT16_MAX ? room : UINT16_MAX),
        .slots_served = stream->at + (stream->served != 0),
        .samples_starved = stream->starved,
        .rounds_moved = stream->moved,
        .rounds_late = stream->late,
        .looping = stream->repeats,
    };
    if (feed->fill != NULL) {
        feed->fill(&status);
    }
    bt_msg_emu_status_pack(&status, payload);
    send_message(feed, BT_EMU_STATUS_ID, payload, sizeof payload);
}

// The status shows slots that did not fit.
static uint8_t put_tape(bt_emu_feed *feed)
{
    bt_emu_stream *stream = feed->stream;
    const bt_msg_emu_tape *tape = &feed->got.tape;
    if (tape->fingers == 0 || tape->fingers > BT_MAX_FINGERS || tape->slots == 0
        || 2 * tape->slots * tape->fingers > (int)sizeof tape->samples) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    if (tape->first_slot == stream->written) {
        (void)bt_emu_stream_put(stream, tape->fingers, tape->samples, tape->slots);
    }
    return BT_ERROR_OK;
}

static uint8_t set_fault(bt_emu_feed *feed)
{
    if (feed->got.fault.finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (feed->got.fault.fault != BT_EMU_FAULT_NONE && feed->got.fault.fault < BT_EMU_FAULT_SWAPPED) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    feed->stream->fault[feed->got.fault.finger] = feed->got.fault.fault;
    feed->spoilt = true;
    return BT_ERROR_OK;
}

static uint8_t obey(bt_emu_feed *feed, uint8_t id, const uint8_t *payload)
{
    bt_emu_stream *stream = feed->stream;
    switch (id) {
    case BT_EMU_TAPE_ID:
        bt_msg_emu_tape_unpack(&feed->got.tape, payload);
        return put_tape(feed);
    case BT_EMU_SET_FAULT_ID:
        bt_msg_emu_set_fault_unpack(&feed->got.fault, payload);
        return set_fault(feed);
    case BT_EMU_PLAY_ID:
        bt_msg_emu_play_unpack(&feed->got.play, payload);
        stream->hold = feed->got.play.hold_slot;
        stream->by_time = feed->got.play.by_time;
        stream->live = feed->got.play.live;
        return BT_ERROR_OK;
    case BT_EMU_GET_STATUS_ID:
        return BT_ERROR_OK;
    default:
        return feed->obey != NULL ? feed->obey(id, payload) : BT_ERROR_UNKNOWN_COMMAND;
    }
}

static void answer(bt_emu_feed *feed, uint8_t id, const uint8_t *payload)
{
    const uint8_t req_id = payload[0]; // every command begins with it
    if (id == BT_HELLO_REQUEST_ID) {
        bt_msg_hello_request_unpack(&feed->got.hello, payload);
        send_hello(feed);
        return;
    }
    const uint8_t error = obey(feed, id, payload);
    if (error == BT_ERROR_OK && id >= BT_EMU_PLUG_ID) {
        send_status(feed, req_id);
        return;
    }
    uint8_t reply[BT_REPLY_BYTES];
    bt_msg_reply_pack(&(bt_msg_reply){req_id, id, error}, reply);
    send_message(feed, BT_REPLY_ID, reply, sizeof reply);
}

void bt_emu_feed_begin(bt_emu_feed *feed)
{
    feed->reported = UINT32_MAX;
    bt_deframer_reset(&feed->deframer);
}

// The deframer has checked messages of link.toml.
static bool has_its_length(const bt_deframer *deframer)
{
    const int bytes = bt_emu_payload_bytes(deframer->id);
    return bytes < 0 || bytes == deframer->payload_bytes;
}

void bt_emu_feed_receive(bt_emu_feed *feed, const uint8_t *bytes, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        if (bt_deframer_push(&feed->deframer, bytes[k]) == BT_DEFRAMED_GOOD
            && feed->deframer.payload_bytes > 0 && has_its_length(&feed->deframer)) {
            answer(feed, feed->deframer.id, feed->deframer.buffer + 1);
        }
    }
}

void bt_emu_feed_report(bt_emu_feed *feed)
{
    if (feed->reported != feed->stream->written) {
        feed->reported = feed->stream->written;
        send_status(feed, 0);
    }
}
