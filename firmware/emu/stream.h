// Counts for the emulated sensors: a ring of slots that one writer fills while the bus reads it, or a whole
// tape. Two readers:
// - in_order, of the sensor board (firmware/sensor_board/in_order.h)
// - by_clock: the time since the first sample command determines the slot. Where time can stand still, it
//   stands still while the next slot is missing (bt_emu_stream_lacks), and no sample is ever late.
#ifndef BIOTAC_EMU_STREAM_H
#define BIOTAC_EMU_STREAM_H

#include "device.h"

#include <stddef.h>

#define BT_EMU_NO_HOLD UINT32_MAX

typedef struct {
    uint16_t *ring;       // [slot][finger]
    const uint16_t *tape; // or a whole tape, laid out likewise; NULL: the ring
    bool repeats;         // that tape has no end
    uint32_t slots;       // in whole rounds: room in the ring, or length of the tape
    uint8_t fingers;
    volatile uint32_t written; // slots so far; set by the writer
    volatile uint32_t at;      // the slot being served; written by the reader, as all below
    bool started;

    // by_clock
    uint64_t start_ns;  // of slot 0
    uint32_t begins_at; // the slot of the first sample command, a round's first

    // in_order
    uint32_t ring_at;  // the slot's place in the ring
    uint8_t slot;      // number in the round
    uint8_t served;    // bit mask of fingers that have had that slot's sample
    bool waits;        // after a hold, for a round that all fingers begin together
    uint8_t asked;     // bit mask of fingers asked for a property since their last sample
    uint32_t starved;  // samples requested beyond the last
    bool timed;        // the next two are valid
    uint32_t round_us; // when the latest round began
    int32_t behind_us; // by which the bus's place on the tape is behind the clock
    int32_t moved;     // rounds skipped for that, less those repeated
    uint32_t late;     // rounds missing when the bus began them: the one before was repeated

    volatile uint16_t fault[BT_MAX_FINGERS]; // enum bt_emu_fault; written by the writer, as all below
    volatile uint32_t hold;                  // slots from this one on are not served yet
    volatile bool by_time;                   // the tape follows the clock
    volatile bool live;                      // a late round is the one before again
} bt_emu_stream;

// Start empty, with room for so many samples. Only without a reader.
void bt_emu_stream_init(bt_emu_stream *stream, uint16_t *ring, uint32_t samples);

// Number of slots that still fit.
uint32_t bt_emu_stream_room(const bt_emu_stream *stream);

// Append slots: samples [slots][fingers], little-endian. Returns false and adds none if they do not fit or
// the number of fingers has changed.
bool bt_emu_stream_put(bt_emu_stream *stream, uint8_t fingers, const uint8_t *samples, uint32_t slots);

// Repeat these slots, in whole rounds, instead of new ones. Only without a reader.
void bt_emu_stream_loop(bt_emu_stream *stream, const uint16_t *loop, uint8_t fingers, uint32_t slots);

// Play a file of host/biotac/sim/tape.py once; the bytes must outlive the stream. Returns NULL, or the error.
// A caller with only part of the file in memory points tape at it and sets slots.
const char *bt_emu_stream_open(bt_emu_stream *stream, const uint8_t *bytes, size_t size);
#define BT_EMU_TAPE_HEADER_BYTES 24

// The ring's slots in order, [slots][fingers]; NULL if part has been overwritten, or the last round is not
// whole.
const uint16_t *bt_emu_stream_whole(const bt_emu_stream *stream);

// A finger's sample at a place of the ring or tape.
uint16_t bt_emu_stream_sample(const bt_emu_stream *stream, uint32_t place, uint8_t finger);

// A bt_emu_source; context is the stream.
uint16_t bt_emu_stream_by_clock(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

// By the clock: the round of that time, at most the last one there.
uint32_t bt_emu_stream_round(const bt_emu_stream *stream, uint64_t t_ns);

// By the clock: the slot of that time is missing; on a tape, the last one is over.
bool bt_emu_stream_lacks(const bt_emu_stream *stream, uint64_t t_ns);

// By the clock: the time of the first missing slot.
uint64_t bt_emu_stream_lacks_at_ns(const bt_emu_stream *stream);

#endif
