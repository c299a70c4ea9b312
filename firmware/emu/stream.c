#include "stream.h"

#include <string.h>

#define ROUND_US (BT_FRAME_MS * 1000)

void bt_emu_stream_init(bt_emu_stream *stream, uint16_t *ring, uint32_t samples)
{
    memset(stream, 0, sizeof *stream);
    stream->ring = ring;
    stream->slots = samples; // in samples until the number of fingers is known
    stream->hold = BT_EMU_NO_HOLD;
}

void bt_emu_stream_loop(bt_emu_stream *stream, const uint16_t *loop, uint8_t fingers, uint32_t slots)
{
    bt_emu_stream_init(stream, NULL, slots);
    stream->loop = loop;
    stream->fingers = fingers;
}

const uint16_t *bt_emu_stream_whole(const bt_emu_stream *stream)
{
    bool whole = stream->loop == NULL && stream->taken <= stream->slots && stream->taken % BT_SLOTS == 0;
    return whole ? stream->ring : NULL;
}

// With by_time, a round behind the bus stays, to be repeated.
uint32_t bt_emu_stream_room(const bt_emu_stream *stream)
{
    uint32_t used = stream->taken - stream->at + (stream->by_time ? BT_SLOTS : 0);
    return stream->loop == NULL && used < stream->slots ? stream->slots - used : 0;
}

// Slots left, from the one being served on.
static uint32_t left(const bt_emu_stream *stream)
{
    return stream->loop != NULL ? UINT32_MAX : stream->taken - stream->at;
}

bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots)
{
    if (stream->loop != NULL || fingers == 0 || fingers > BT_MAX_FINGERS
        || (stream->fingers != 0 && fingers != stream->fingers)) {
        return false;
    }
    if (stream->fingers == 0) {
        stream->slots = stream->slots / fingers / BT_SLOTS * BT_SLOTS;
        stream->fingers = fingers;
    }
    if (slots > bt_emu_stream_room(stream)) {
        return false;
    }
    uint32_t at = stream->taken % stream->slots * fingers;
    for (uint32_t k = 0; k < slots * fingers; k++) {
        stream->ring[at] = (uint16_t)(samples[2 * k] | samples[2 * k + 1] << 8);
        at = at + 1 == stream->slots * fingers ? 0 : at + 1;
    }
    stream->taken = stream->taken + slots;
    return true;
}

// How far ahead this channel's next slot is: 0 to BT_SLOTS, counting from the one being served, or from the
// next if the finger has had that; -1: there is none.
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

static void go_on(bt_emu_stream *stream, uint32_t slots)
{
    stream->at = stream->at + slots;
    stream->ring_at += slots;
    stream->ring_at -= stream->ring_at >= stream->slots ? stream->slots : 0;
    stream->slot = (uint8_t)(stream->slot + slots);
    stream->slot = (uint8_t)(stream->slot - (stream->slot >= BT_SLOTS ? BT_SLOTS : 0));
    stream->served = 0;
}

static uint16_t sample_now(const bt_emu_stream *stream, uint8_t finger)
{
    const uint16_t *samples = stream->loop != NULL ? stream->loop : stream->ring;
    return samples[stream->ring_at * stream->fingers + finger];
}

static uint16_t line_now(const bt_emu_stream *stream, uint8_t finger)
{
    bool playing = stream->started && finger < stream->fingers && left(stream) != 0;
    uint16_t now = playing ? sample_now(stream, finger) : 0;
    return now > BT_FULL_SCALE_COUNT ? now : 0;
}

// At the start of a round: skip or repeat rounds to keep to the clock, as far as there are any.
static void keep_time(bt_emu_stream *stream, uint32_t ahead, uint64_t t_ns)
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
    while (stream->behind_us >= ROUND_US && left(stream) > BT_SLOTS + ahead) {
        go_on(stream, BT_SLOTS);
        stream->behind_us -= ROUND_US;
        stream->moved++;
    }
    if (stream->behind_us <= -ROUND_US && stream->at >= BT_SLOTS) {
        stream->at = stream->at - BT_SLOTS;
        stream->ring_at =
            (stream->ring_at < BT_SLOTS ? stream->ring_at + stream->slots : stream->ring_at) - BT_SLOTS;
        stream->behind_us += ROUND_US;
        stream->moved--;
    }
}

// True if the slot so far ahead may be served. After a hold the tape goes on when every finger begins a
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
    return !stream->waits && left(stream) > ahead;
}

uint16_t bt_emu_stream_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
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
    if (!may_serve(stream, finger, (uint32_t)ahead)) {
        stream->starved++;
        return fault != BT_EMU_FAULT_NONE ? fault : BT_EMU_FAULT_STUCK_LOW;
    }
    if (stream->slot + ahead >= BT_SLOTS || !stream->started) {
        keep_time(stream, (uint32_t)ahead, t_ns);
    }
    if (ahead > 0) {
        go_on(stream, (uint32_t)ahead);
    }
    stream->started = true;
    stream->served = (uint8_t)(stream->served | 1u << finger);
    if (fault != BT_EMU_FAULT_NONE) {
        return fault;
    }
    return finger < stream->fingers ? sample_now(stream, finger) : BT_EMU_FAULT_STUCK_LOW;
}
