// The emulated sensors as a program: plays a course of bus steps and writes the words that MISO carried.
//   course TAPE < STEPS > WORDS
// A step is u32 kind (0: chip selects, 1: transfer), u32 value, u64 ns, little-endian; a word is u16.
#include "bus.h"
#include "stream.h"

#include <stdio.h>

static _Alignas(uint16_t) unsigned char tape_bytes[1 << 20];

int main(int argc, char **argv)
{
    static bt_emu_stream stream;
    static bt_emu_bus bus;
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        return 2;
    }
    size_t bytes = fread(tape_bytes, 1, sizeof tape_bytes, file);
    (void)fclose(file);
    if (bt_emu_stream_open(&stream, tape_bytes, bytes) != NULL) {
        return 2;
    }
    bt_emu_bus_init(&bus, stream.fingers, "BT12345678ABCDEF,,x", bt_emu_stream_by_clock, &stream);
    struct {
        uint32_t kind, value;
        uint64_t t_ns;
    } step;
    while (fread(&step, sizeof step, 1, stdin) == 1) {
        if (step.kind == 0) {
            bt_emu_bus_select(&bus, (uint8_t)step.value, step.t_ns);
        } else {
            uint16_t word = bt_emu_bus_transfer16(&bus, (uint16_t)step.value, step.t_ns);
            (void)fwrite(&word, sizeof word, 1, stdout);
        }
    }
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        uint16_t early = (uint16_t)bus.sensor[f].early_reads;
        (void)fwrite(&early, sizeof early, 1, stdout);
    }
    return 0;
}
