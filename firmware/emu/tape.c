#include "tape.h"

#include "device.h"
#include "wire/little_endian.h"
#include "wire/sensor_gen.h"

#include <string.h>

#define HEADER_BYTES 24
// Slot k begins k/4400 s after the start, truncated to us by the sampler: half a slot of slack
// puts every sample command into its own slot.
#define HALF_SLOT_NS (500000000ull / BT_SLOT_HZ)

const char *bt_tape_open(bt_tape *tape, const uint8_t *bytes, size_t size)
{
    memset(tape, 0, sizeof *tape);
    if (size < HEADER_BYTES || memcmp(bytes, "BTTAPE01", 8) != 0) {
        return "not a tape of version 01";
    }
    tape->fingers = bt_get_u32(bytes + 8);
    tape->rounds = bt_get_u32(bytes + 12);
    tape->samples = bytes + HEADER_BYTES;
    if (bt_get_u32(bytes + 16) != BT_SLOTS) {
        return "made for another slot sequence";
    }
    if (tape->fingers < 1 || tape->fingers > BT_MAX_FINGERS || tape->rounds < 1) {
        return "not of 1 to 5 fingers and at least one round";
    }
    if (size - HEADER_BYTES != (size_t)tape->rounds * tape->fingers * BT_SLOTS * 2) {
        return "its length does not fit its header";
    }
    return NULL;
}

static uint64_t slot_number(const bt_tape *tape, uint64_t t_ns)
{
    return (t_ns - tape->start_ns + HALF_SLOT_NS) * BT_SLOT_HZ / 1000000000ull;
}

static uint16_t sample(const bt_tape *tape, uint64_t round, uint8_t finger, uint64_t slot)
{
    size_t at = (size_t)(((round - tape->first_round) * tape->fingers + finger) * BT_SLOTS + slot) * 2;
    return (uint16_t)(tape->samples[at] | tape->samples[at + 1] << 8);
}

uint32_t bt_tape_round(const bt_tape *tape, uint64_t t_ns)
{
    uint64_t round = tape->started ? slot_number(tape, t_ns) / BT_SLOTS : 0;
    return (uint32_t)(round < tape->rounds ? round : tape->rounds - 1);
}

uint16_t bt_tape_count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    bt_tape *tape = context;
    if (channel == BT_EMU_LINE && (!tape->started || finger >= tape->fingers)) {
        return 0;
    }
    if (!tape->started) {
        tape->started = true;
        tape->start_ns = t_ns;
    }
    if (finger >= tape->fingers) {
        return BT_EMU_FAULT_STUCK_LOW;
    }
    uint64_t number = slot_number(tape, t_ns);
    uint32_t round = bt_tape_round(tape, t_ns);
    if (channel == BT_EMU_LINE) {
        uint16_t now = sample(tape, round, finger, number % BT_SLOTS);
        return now > BT_FULL_SCALE_COUNT ? now : 0;
    }
    // In the default sequence the slot determines the channel. Another sequence gets its channel's next
    // sample of the same round.
    for (uint64_t k = 0; k < BT_SLOTS; k++) {
        uint64_t slot = (number + k) % BT_SLOTS;
        if (BT_EMU_CHANNEL(bt_channel_command[bt_slot_channel[slot]]) == channel) {
            return sample(tape, round, finger, slot);
        }
    }
    return BT_EMU_FAULT_NO_CHANNEL;
}

bool bt_tape_over(const bt_tape *tape, uint64_t t_ns)
{
    return tape->started && slot_number(tape, t_ns) >= (uint64_t)tape->rounds * BT_SLOTS;
}
