#include "in_order.h"

#define ROUND_US (BT_FRAME_MS * 1000)

// Slots left, from the one being served on.
static uint32_t slots_left(const bt_emu_stream *stream)
{
    return stream->repeats ? UINT32_MAX : stream->written - stream->at;
}

// Distance to this channel's next slot: 0 to BT_SLOTS, from the slot being served, or from the next if the
// finger has had that; -1: there is none.
static int slots_ahead(const bt_emu_stream *stream, uint8_t finger, uint8_t channel)
{
    int first = stream->served >> finger & 1;
    uint8_t slot = (uint8_t)(stream->slot + first);
    for (int k = first; k <= BT_SLOTS; k++) {
        slot = slot >= BT_SLOTS ? 0 : slot;
        if (BT_EMU_CHANNEL(bt_channel_command[bt_slot_channel[slot]]) == channel) {
            return k;
        }
        slot++;
    }
    return -1;
}

static void advance(bt_emu_stream *stream, uint32_t slots)
{
    stream->at = stream->at + slots;
    stream->ring_at += slots;
    stream->ring_at -= stream->ring_at >= stream->slots ? stream->slots : 0;
    stream->slot = (uint8_t)(stream->slot + slots);
    stream->slot = (uint8_t)(stream->slot - (stream->slot >= BT_SLOTS ? BT_SLOTS : 0));
    stream->served = 0;
}

// The round before the bus is still in the ring, by bt_emu_stream_room. In the first round the place wraps
// until the bus goes on.
static void rewind_round(bt_emu_stream *stream)
{
    stream->at = stream->at - BT_SLOTS;
    stream->ring_at =
        (stream->ring_at < BT_SLOTS ? stream->ring_at + stream->slots : stream->ring_at) - BT_SLOTS;
}

static uint16_t sample_now(const bt_emu_stream *stream, uint8_t finger)
{
    return bt_emu_stream_sample(stream, stream->ring_at, finger);
}

static uint16_t line_now(const bt_emu_stream *stream, uint8_t finger)
{
    bool playing = stream->started && finger < stream->fingers && slots_left(stream) != 0;
    uint16_t now = playing ? sample_now(stream, finger) : 0;
    return now > BT_FULL_SCALE_COUNT ? now : 0;
}

// At the start of a round: skip or repeat rounds to follow the clock, as far as there are any.
static void follow_clock(bt_emu_stream *stream, uint32_t ahead, uint64_t t_ns)
{
    bool timed = stream->timed;
    stream->timed = stream->by_time;
    if (!stream->timed) {
        return;
    }
    uint32_t now_us = (uint32_t)(t_ns / 1000); // a hundred cycles, spent only with by_time
    int32_t passed_us = (int32_t)(now_us - stream->round_us);
    stream->round_us = now_us;
    stream->behind_us = timed ? stream->behind_us + passed_us - ROUND_US : 0;
    while (stream->behind_us >= ROUND_US && slots_left(stream) > BT_SLOTS + ahead) {
        advance(stream, BT_SLOTS);
        stream->behind_us -= ROUND_US;
        stream->moved++;
    }
    if (stream->behind_us <= -ROUND_US && stream->at >= BT_SLOTS) {
        rewind_round(stream);
        stream->behind_us += ROUND_US;
        stream->moved--;
    }
}

// A live load's next round is late or incomplete: the sensors feel the one before for another round.
static void repeat_if_late(bt_emu_stream *stream, uint32_t ahead)
{
    bool begins = stream->slot + ahead >= BT_SLOTS;
    if (stream->live && begins && slots_left(stream) < ahead + BT_SLOTS && stream->started) {
        rewind_round(stream);
        stream->behind_us += ROUND_US;
        stream->late++;
    }
}

// True if the slot at this distance may be served. After a hold the tape goes on when every finger begins a
// round.
static bool may_serve(bt_emu_stream *stream, uint8_t finger, uint32_t ahead)
{
    uint8_t all = (uint8_t)((1u << stream->fingers) - 1);
    bool together = (stream->asked & all) == all;
    stream->asked = (uint8_t)(stream->asked & ~(1u << finger));
    if (stream->at + ahead >= stream->hold) {
        stream->waits = true;
    } else if (stream->waits && together) {
        stream->waits = stream->timed = false;
    }
    return !stream->waits && slots_left(stream) > ahead;
}

uint16_t bt_emu_stream_in_order(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    bt_emu_stream *stream = context;
    uint16_t fault = stream->fault[finger];
    if (channel == BT_EMU_LINE) {
        stream->asked = (uint8_t)(stream->asked | 1u << finger);
        return fault != BT_EMU_FAULT_NONE ? fault : line_now(stream, finger);
    }
    int ahead = slots_ahead(stream, finger, channel);
    if (ahead < 0) {
        return fault != BT_EMU_FAULT_NONE ? fault : BT_EMU_FAULT_NO_CHANNEL;
    }
    repeat_if_late(stream, (uint32_t)ahead);
    if (!may_serve(stream, finger, (uint32_t)ahead)) {
        stream->starved++;
        return fault != BT_EMU_FAULT_NONE ? fault : BT_EMU_FAULT_STUCK_LOW;
    }
    if (stream->slot + ahead >= BT_SLOTS || !stream->started) {
        follow_clock(stream, (uint32_t)ahead, t_ns);
    }
    if (ahead > 0) {
        advance(stream, (uint32_t)ahead);
    }
    stream->started = true;
    stream->served = (uint8_t)(stream->served | 1u << finger);
    if (fault != BT_EMU_FAULT_NONE) {
        return fault;
    }
    return finger < stream->fingers ? sample_now(stream, finger) : BT_EMU_FAULT_STUCK_LOW;
}
