// The emulated sensors of firmware/emu as a WebAssembly module: what sensors.mjs calls.
//
// Times cross as double, which is exact to 2^53 ns (104 days) and saves a BigInt per call.
#include "bus.h"
#include "tape.h"

#define EXPORT(name)  __attribute__((export_name(name)))
#define PAGE_BYTES    65536u
#define SERIALS_BYTES 128u

extern unsigned char __heap_base;

static bt_tape tape;
static bt_emu_bus bus;
static char serials[SERIALS_BYTES];
static bool sampled_behind_the_end;

// Room for a file of so many bytes, behind everything else; 0 when memory does not reach.
EXPORT("room") unsigned char *room(uint32_t bytes)
{
    size_t end = (size_t)&__heap_base + bytes;
    size_t have = __builtin_wasm_memory_size(0) * PAGE_BYTES;
    if (end > have
        && __builtin_wasm_memory_grow(0, (end - have + PAGE_BYTES - 1) / PAGE_BYTES) == (size_t)-1) {
        return NULL;
    }
    return &__heap_base;
}

// Where to put the serial numbers, separated by commas and ended by a 0: SERIALS_BYTES of room.
EXPORT("serials") char *serials_at(void)
{
    return serials;
}

static uint16_t count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    // The tape's last sample is over when somebody asks for the next one.
    sampled_behind_the_end = sampled_behind_the_end || (channel != BT_EMU_LINE && bt_tape_over(&tape, t_ns));
    return bt_tape_count(context, finger, channel, t_ns);
}

// Plug in: 0, or the address of what is wrong with the tape that lies at room().
EXPORT("plug_in") const char *plug_in(uint32_t bytes)
{
    const char *wrong = bt_tape_open(&tape, &__heap_base, bytes);
    if (wrong == NULL) {
        bt_emu_bus_init(&bus, tape.fingers, serials, count, &tape);
    }
    return wrong;
}

// Power lost and back: the sensors forget what they were asked, the world they feel goes on.
EXPORT("power_cycle") void power_cycle(void)
{
    bt_emu_bus_init(&bus, tape.fingers, serials, count, &tape);
}

EXPORT("select") void select_sensors(uint32_t mask, double t_ns)
{
    bt_emu_bus_select(&bus, (uint8_t)mask, (uint64_t)t_ns);
}

EXPORT("transfer") uint32_t transfer(uint32_t mosi, double t_ns)
{
    return bt_emu_bus_transfer16(&bus, (uint16_t)mosi, (uint64_t)t_ns);
}

EXPORT("transfer_byte") uint32_t transfer_byte(uint32_t mosi, double t_ns)
{
    return bt_emu_bus_transfer8(&bus, (uint8_t)mosi, (uint64_t)t_ns);
}

EXPORT("started") int started(void)
{
    return tape.started;
}

EXPORT("over") int over(void)
{
    return sampled_behind_the_end;
}

EXPORT("early_reads") uint32_t early_reads(uint32_t finger)
{
    return bus.sensor[finger].early_reads;
}
