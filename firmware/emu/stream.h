// Counts for the emulated sensors that come while they are played: a ring of slots with one writer, and the
// bus as its reader. The tape's order is what counts: each sample command gets its channel's next sample, and
// all fingers stay in the same slot. Of time, where it is to count, whole rounds are made good.
#ifndef BIOTAC_EMU_STREAM_H
#define BIOTAC_EMU_STREAM_H

#include "device.h"

#define BT_EMU_NO_HOLD UINT32_MAX

typedef struct {
    uint16_t *ring;       // [slot][finger]
    const uint16_t *loop; // or a tape that is played over and over, laid out likewise; NULL: the ring
    uint32_t slots;       // it has room for, or the loop has: whole rounds
    uint8_t fingers;
    volatile uint32_t taken; // slots that came; the writer's
    volatile uint32_t at;    // the slot being served; the reader's, as all below
    uint32_t ring_at;        // where it lies
    uint8_t slot;            // which of a round it is
    uint8_t served;          // who has had his sample of it: bit mask
    bool started;
    bool waits;        // behind a hold, for a round in which all fingers begin
    uint8_t asked;     // who was asked for a property since his last sample: bit mask
    uint32_t starved;  // samples asked for behind the last
    bool timed;        // these three hold:
    uint32_t round_us; // when the latest round began
    int32_t behind_us; // by the clock: the bus's place on the tape
    int32_t moved;     // rounds left out for that, less those played again

    volatile uint16_t fault[BT_MAX_FINGERS]; // enum bt_emu_fault; the writer's, as all below
    volatile uint32_t hold;                  // the first slot that is not served yet
    volatile bool by_time;                   // the tape keeps to the clock
} bt_emu_stream;

// Empty, with room for so many samples; while nobody reads.
void bt_emu_stream_init(bt_emu_stream *stream, uint16_t *ring, uint32_t samples);

// How many more slots fit.
uint32_t bt_emu_stream_room(const bt_emu_stream *stream);

// The next slots: samples [slots][fingers], little-endian. False, and nothing is taken, when they do not fit
// or have another number of fingers than those before.
bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots);

// Play these slots, whole rounds, over and over, in place of what would come; while nobody reads.
void bt_emu_stream_loop(bt_emu_stream *stream, const uint16_t *loop, uint8_t fingers, uint32_t slots);

// The tape as it came, [slots taken][fingers]; NULL when some of it has been overwritten, or it is no whole
// rounds.
const uint16_t *bt_emu_stream_whole(const bt_emu_stream *stream);

// A bt_emu_source; context is the stream.
uint16_t bt_emu_stream_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

#endif
