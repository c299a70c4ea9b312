#include "feed.h"

// The status says what was not taken.
static uint8_t put_tape(bt_emu_stream *stream, const uint8_t *payload)
{
    static bt_msg_emu_tape tape; // it is large for a stack of interrupts and commands
    bt_msg_emu_tape_unpack(&tape, payload);
    if (tape.fingers == 0 || tape.fingers > BT_MAX_FINGERS || tape.slots == 0
        || 2 * tape.slots * tape.fingers > (int)sizeof tape.samples) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    if (tape.first_slot == stream->taken) {
        (void)bt_emu_stream_put(stream, tape.fingers, tape.samples, tape.slots);
    }
    return BT_ERROR_OK;
}

static uint8_t set_fault(bt_emu_stream *stream, const uint8_t *payload)
{
    bt_msg_emu_set_fault command;
    bt_msg_emu_set_fault_unpack(&command, payload);
    if (command.finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    if (command.fault != BT_EMU_FAULT_NONE && command.fault < BT_EMU_FAULT_SWAPPED) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    stream->fault[command.finger] = command.fault;
    return BT_ERROR_OK;
}

static uint8_t play(bt_emu_stream *stream, const uint8_t *payload)
{
    bt_msg_emu_play command;
    bt_msg_emu_play_unpack(&command, payload);
    stream->hold = command.hold_slot;
    stream->by_time = command.by_time;
    stream->live = command.live;
    return BT_ERROR_OK;
}

uint8_t bt_emu_obey(bt_emu_stream *stream, uint8_t id, const uint8_t *payload)
{
    switch (id) {
    case BT_EMU_TAPE_ID:
        return put_tape(stream, payload);
    case BT_EMU_SET_FAULT_ID:
        return set_fault(stream, payload);
    case BT_EMU_PLAY_ID:
        return play(stream, payload);
    case BT_EMU_GET_STATUS_ID:
        return BT_ERROR_OK;
    default:
        return BT_ERROR_UNKNOWN_COMMAND;
    }
}

bt_msg_emu_status bt_emu_status_of(const bt_emu_stream *stream)
{
    const uint32_t room = bt_emu_stream_room(stream);
    return (bt_msg_emu_status){
        .slots_taken = stream->taken,
        .room_slots = (uint16_t)(room < UINT16_MAX ? room : UINT16_MAX),
        .slots_served = stream->at + (stream->served != 0),
        .samples_starved = stream->starved,
        .rounds_moved = stream->moved,
        .rounds_late = stream->late,
        .looping = stream->repeats,
    };
}

// ---- over a byte pipe ----------------------------------------------------------------------------------

static void send_message(const bt_emu_feed *feed, uint8_t id, const uint8_t *payload)
{
    uint8_t frame[BT_ENCODED_MAX_BYTES];
    feed->send(frame, bt_frame_encode(id, payload, (size_t)bt_wire_payload_bytes(id), frame));
}

static void send_status(const bt_emu_feed *feed, uint8_t req_id)
{
    uint8_t payload[BT_EMU_STATUS_BYTES];
    bt_msg_emu_status status = bt_emu_status_of(feed->stream);
    status.req_id = req_id;
    status.fingers = (uint8_t)((1u << feed->stream->fingers) - 1);
    status.link_bytes = feed->link_bytes;
    bt_msg_emu_status_pack(&status, payload);
    send_message(feed, BT_EMU_STATUS_ID, payload);
}

static void answer(const bt_emu_feed *feed, uint8_t id, const uint8_t *payload)
{
    const uint8_t req_id = payload[0]; // every command begins with it
    const uint8_t error = bt_emu_obey(feed->stream, id, payload);
    if (error == BT_ERROR_OK) {
        send_status(feed, req_id);
        return;
    }
    uint8_t reply[BT_REPLY_BYTES];
    bt_msg_reply_pack(&(bt_msg_reply){req_id, id, error}, reply);
    send_message(feed, BT_REPLY_ID, reply);
}

void bt_emu_feed_begin(bt_emu_feed *feed, bt_emu_stream *stream, void (*send)(const uint8_t *, size_t))
{
    feed->stream = stream;
    feed->send = send;
    feed->reported = UINT32_MAX;
    bt_deframer_reset(&feed->deframer);
}

void bt_emu_feed_receive(bt_emu_feed *feed, const uint8_t *bytes, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        if (bt_deframer_push(&feed->deframer, bytes[k]) == BT_DEFRAMED_GOOD
            && feed->deframer.payload_bytes > 0) {
            answer(feed, feed->deframer.id, feed->deframer.buffer + 1);
        }
    }
}

void bt_emu_feed_report(bt_emu_feed *feed)
{
    if (feed->reported != feed->stream->taken) {
        feed->reported = feed->stream->taken;
        send_status(feed, 0);
    }
}
