// Counts for the emulated sensors, prepared by the host (host/biotac/sim/tape.py): one uint16 per
// round, finger and slot, little-endian, after a 24-byte header. Values above 4095 are
// faults: enum bt_emu_fault of the wire.
#ifndef BIOTAC_EMU_TAPE_H
#define BIOTAC_EMU_TAPE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint32_t fingers;
    uint32_t rounds;
    const uint8_t *samples; // from first_round on
    uint32_t first_round;   // 0, unless the caller has but a part of the file in memory
    uint64_t start_ns;      // of round 0's first slot
    bool started;
} bt_tape;

// Take the file's bytes, which must outlive the tape. Returns NULL, or what is wrong with them.
const char *bt_tape_open(bt_tape *tape, const uint8_t *bytes, size_t size);

// A bt_emu_source; context is the tape. The first sample command starts the tape.
uint16_t bt_tape_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

// The round whose samples bt_tape_count looks at by then.
uint32_t bt_tape_round(const bt_tape *tape, uint64_t t_ns);

// True if the last round's last slot is over by t_ns.
bool bt_tape_over(const bt_tape *tape, uint64_t t_ns);

#endif
