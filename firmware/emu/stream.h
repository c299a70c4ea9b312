// Counts for the emulated sensors that come while they are played: a ring of slots with one writer, and the
// bus as its reader. The tape's order is what counts, not the time: each sample command gets its channel's
// next sample, and all fingers stay in the same slot.
#ifndef BIOTAC_EMU_STREAM_H
#define BIOTAC_EMU_STREAM_H

#include "device.h"

typedef struct {
    uint16_t *ring; // [slot][finger]
    uint32_t slots; // it has room for: whole rounds
    uint8_t fingers;
    volatile uint32_t taken; // slots that came; the writer's
    volatile uint32_t at;    // the slot being served; the reader's, as all below
    uint32_t ring_at;        // where it lies
    uint8_t slot;            // which of a round it is
    uint8_t served;          // who has had his sample of it: bit mask
    bool started;
    uint32_t starved;                        // samples asked for behind the last
    volatile uint16_t fault[BT_MAX_FINGERS]; // enum bt_emu_fault; the writer's
} bt_emu_stream;

// Empty, with room for so many samples; while nobody reads.
void bt_emu_stream_init(bt_emu_stream *stream, uint16_t *ring, uint32_t samples);

// How many more slots fit.
uint32_t bt_emu_stream_room(const bt_emu_stream *stream);

// The next slots: samples [slots][fingers], little-endian. False, and nothing is taken, when they do not fit
// or have another number of fingers than those before.
bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots);

// A bt_emu_source; context is the stream.
uint16_t bt_emu_stream_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

#endif
