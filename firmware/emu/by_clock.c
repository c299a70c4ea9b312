#include "stream.h"

// Slot k begins k/4400 s after the start, truncated to us by the sampler: half a slot of slack puts every
// sample command into the right slot.
#define HALF_SLOT_NS (500000000ull / BT_SLOT_HZ)

static uint64_t slot_number(const bt_emu_stream *stream, uint64_t t_ns)
{
    return (t_ns - stream->start_ns + HALF_SLOT_NS) * BT_SLOT_HZ / 1000000000ull;
}

bool bt_emu_stream_lacks(const bt_emu_stream *stream, uint64_t t_ns)
{
    return (stream->started ? slot_number(stream, t_ns) : stream->begins_at) >= stream->written;
}

uint64_t bt_emu_stream_lacks_at_ns(const bt_emu_stream *stream)
{
    return stream->start_ns + stream->written * 1000000000ull / BT_SLOT_HZ;
}

uint32_t bt_emu_stream_round(const bt_emu_stream *stream, uint64_t t_ns)
{
    const uint64_t number = stream->started ? slot_number(stream, t_ns) : stream->begins_at;
    return (uint32_t)(number < stream->written ? number : stream->written - 1) / BT_SLOTS;
}

// In the default sequence the slot determines the channel. Another sequence gets the channel's next sample of
// the same round. Beyond the last round, samples are that round's.
uint16_t bt_emu_stream_by_clock(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    bt_emu_stream *stream = context;
    const bool line = channel == BT_EMU_LINE;
    const uint16_t fault = stream->fault[finger];
    if (!line && !stream->started) {
        stream->started = true;
        stream->start_ns = t_ns - stream->begins_at / BT_SLOTS * (uint64_t)BT_FRAME_MS * 1000000u;
    }
    if (fault != BT_EMU_FAULT_NONE) {
        return fault;
    }
    if (!stream->started || finger >= stream->fingers || stream->written < BT_SLOTS) {
        return line ? 0 : BT_EMU_FAULT_STUCK_LOW;
    }
    const uint64_t number = slot_number(stream, t_ns);
    const uint32_t round_at = bt_emu_stream_round(stream, t_ns) * BT_SLOTS;
    stream->at = round_at;
    for (uint32_t k = 0; k < BT_SLOTS; k++) {
        const uint32_t slot = (uint32_t)((number + k) % BT_SLOTS);
        if (line || BT_EMU_CHANNEL(bt_channel_command[bt_slot_channel[slot]]) == channel) {
            const uint16_t count = bt_emu_stream_sample(stream, (round_at + slot) % stream->slots, finger);
            return line && count <= BT_FULL_SCALE_COUNT ? 0 : count;
        }
    }
    return BT_EMU_FAULT_NO_CHANNEL;
}
