#include "stream.h"

#include "wire/little_endian.h"

#include <string.h>

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
    stream->tape = loop;
    stream->repeats = true;
    stream->fingers = fingers;
}

const char *bt_emu_stream_open(bt_emu_stream *stream, const uint8_t *bytes, size_t size)
{
    if (size < BT_EMU_TAPE_HEADER_BYTES || memcmp(bytes, "BTTAPE02", 8) != 0) {
        return "not a tape of version 02";
    }
    uint32_t fingers = bt_get_u32(bytes + 8);
    uint32_t rounds = bt_get_u32(bytes + 12);
    if (bt_get_u32(bytes + 16) != BT_SLOTS) {
        return "made for another slot sequence";
    }
    if (fingers < 1 || fingers > BT_MAX_FINGERS || rounds < 1 || rounds > UINT32_MAX / BT_SLOTS) {
        return "not of 1 to 5 fingers and at least one round";
    }
    if ((size - BT_EMU_TAPE_HEADER_BYTES) / 2 / BT_SLOTS / fingers != rounds
        || (size - BT_EMU_TAPE_HEADER_BYTES) % (2 * BT_SLOTS * fingers) != 0) {
        return "its length does not fit its header";
    }
    bt_emu_stream_init(stream, NULL, rounds * BT_SLOTS);
    stream->tape = (const uint16_t *)(const void *)(bytes + BT_EMU_TAPE_HEADER_BYTES);
    stream->fingers = (uint8_t)fingers;
    stream->written = stream->slots;
    return NULL;
}

const uint16_t *bt_emu_stream_whole(const bt_emu_stream *stream)
{
    bool whole = stream->tape == NULL && stream->written <= stream->slots && stream->written % BT_SLOTS == 0;
    return whole ? stream->ring : NULL;
}

uint16_t bt_emu_stream_sample(const bt_emu_stream *stream, uint32_t place, uint8_t finger)
{
    const uint16_t *samples = stream->tape != NULL ? stream->tape : stream->ring;
    return samples[place * stream->fingers + finger];
}

// A round behind the bus stays where it may be repeated.
uint32_t bt_emu_stream_room(const bt_emu_stream *stream)
{
    uint32_t used = stream->written - stream->at + (stream->by_time || stream->live ? BT_SLOTS : 0);
    return stream->tape == NULL && used < stream->slots ? stream->slots - used : 0;
}

bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots)
{
    if (stream->tape != NULL || fingers == 0 || fingers > BT_MAX_FINGERS
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
    uint32_t at = stream->written % stream->slots * fingers;
    for (uint32_t k = 0; k < slots * fingers; k++) {
        stream->ring[at] = (uint16_t)(samples[2 * k] | samples[2 * k + 1] << 8);
        at = at + 1 == stream->slots * fingers ? 0 : at + 1;
    }
    stream->written = stream->written + slots;
    return true;
}
