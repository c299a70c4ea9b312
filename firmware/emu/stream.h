// Counts for the emulated sensors that come while they are played: a ring of slots with one writer, and the
// bus as its reader. Samples go by the tape's order, not by time: each sample command gets its channel's next
// sample, and all fingers stay in the same slot. With by_time, whole rounds are skipped or repeated to keep
// to the clock.
#ifndef BIOTAC_EMU_STREAM_H
#define BIOTAC_EMU_STREAM_H

#include "device.h"

#define BT_EMU_NO_HOLD UINT32_MAX

typedef struct {
    uint16_t *ring;       // [slot][finger]
    const uint16_t *loop; // or a tape that is repeated, laid out likewise; NULL: the ring
    uint32_t slots;       // in whole rounds: room in the ring, or length of the loop
    uint8_t fingers;
    volatile uint32_t taken; // slots that came; written by the writer
    volatile uint32_t at;    // the slot being served; written by the reader, as all below
    uint32_t ring_at;        // its place in the ring
    uint8_t slot;            // which of a round it is
    uint8_t served;          // bit mask of fingers that have had their sample of it
    bool started;
    bool waits;        // after a hold, for a round that all fingers begin together
    uint8_t asked;     // bit mask of fingers asked for a property since their last sample
    uint32_t starved;  // samples asked for beyond the last
    bool timed;        // the next two are valid
    uint32_t round_us; // when the latest round began
    int32_t behind_us; // how far the bus's place on the tape is behind the clock
    int32_t moved;     // rounds skipped for that, less those repeated

    volatile uint16_t fault[BT_MAX_FINGERS]; // enum bt_emu_fault; written by the writer, as all below
    volatile uint32_t hold;                  // slots from this one on are not served yet
    volatile bool by_time;                   // the tape keeps to the clock
} bt_emu_stream;

// Start empty, with room for so many samples. Only while nobody reads.
void bt_emu_stream_init(bt_emu_stream *stream, uint16_t *ring, uint32_t samples);

// How many more slots fit.
uint32_t bt_emu_stream_room(const bt_emu_stream *stream);

// Append slots: samples [slots][fingers], little-endian. Returns false and takes nothing if they do not fit
// or the number of fingers has changed.
bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots);

// Repeat these slots, which are whole rounds, instead of what would come. Only while nobody reads.
void bt_emu_stream_loop(bt_emu_stream *stream, const uint16_t *loop, uint8_t fingers, uint32_t slots);

// The tape as it came, [slots taken][fingers]; NULL if part of it has been overwritten, or it is not whole
// rounds.
const uint16_t *bt_emu_stream_whole(const bt_emu_stream *stream);

// A bt_emu_source; context is the stream.
uint16_t bt_emu_stream_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

#endif
