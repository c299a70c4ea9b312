#include "stream.h"

#include <string.h>

void bt_emu_stream_init(bt_emu_stream *stream, uint16_t *ring, uint32_t samples)
{
    memset(stream, 0, sizeof *stream);
    stream->ring = ring;
    stream->slots = samples; // until it is known for how many fingers
}

uint32_t bt_emu_stream_room(const bt_emu_stream *stream)
{
    return stream->slots - (stream->taken - stream->at);
}

bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots)
{
    if (fingers == 0 || fingers > BT_MAX_FINGERS || (stream->fingers != 0 && fingers != stream->fingers)) {
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

static bool is_channel(uint8_t slot, uint8_t channel)
{
    return (bt_channel_command[bt_slot_channel[slot]] & 0x7E) >> 1 == channel;
}

// The next slot of this channel, from the one being served on unless the finger has had that; 0 to BT_SLOTS
// ahead, or -1.
static int slots_ahead(const bt_emu_stream *stream, uint8_t finger, uint8_t channel)
{
    int first = stream->served >> finger & 1;
    uint8_t slot = (uint8_t)(stream->slot + first);
    for (int k = first; k <= BT_SLOTS; k++) {
        slot = slot >= BT_SLOTS ? 0 : slot;
        if (is_channel(slot, channel)) {
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
    return stream->ring[stream->ring_at * stream->fingers + finger];
}

static uint16_t line_now(const bt_emu_stream *stream, uint8_t finger)
{
    bool playing = stream->started && finger < stream->fingers && stream->taken != stream->at;
    uint16_t now = playing ? sample_now(stream, finger) : 0;
    return now > BT_FULL_SCALE_COUNT ? now : 0;
}

uint16_t bt_emu_stream_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    (void)t_ns; // the order is what counts
    bt_emu_stream *stream = context;
    uint16_t fault = stream->fault[finger];
    if (channel == BT_EMU_LINE) {
        return fault != BT_EMU_FAULT_NONE ? fault : line_now(stream, finger);
    }
    int ahead = slots_ahead(stream, finger, channel);
    if (ahead < 0) {
        return fault != BT_EMU_FAULT_NONE ? fault : BT_EMU_FAULT_NO_CHANNEL;
    }
    if (stream->taken - stream->at <= (uint32_t)ahead) {
        stream->starved++;
        return fault != BT_EMU_FAULT_NONE ? fault : BT_EMU_FAULT_STUCK_LOW;
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
