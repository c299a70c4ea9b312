// The emulated sensors of firmware/emu as a WebAssembly module for sensors.mjs.
//
// Times cross as double, which is exact to 2^53 ns (104 days) and saves a BigInt per call.
#include "bus.h"
#include "feed.h"

#include <string.h>

#define EXPORT(name)  __attribute__((export_name(name)))
#define IMPORT(name)  __attribute__((import_module("env"), import_name(name)))
#define PAGE_BYTES    65536u
#define SERIALS_BYTES 128u
#define FED_BYTES     4096u

extern unsigned char __heap_base;

IMPORT("link_bytes") uint32_t link_bytes(void);                   // sent by the board to the host
IMPORT("answer") void answer(const uint8_t *frame, size_t bytes); // to the program that feeds

static bt_emu_stream stream;
static bt_emu_bus bus;
static char serials[SERIALS_BYTES];

static void fill(bt_msg_emu_status *status)
{
    status->link_bytes = link_bytes();
}

static bt_emu_feed feed = {.stream = &stream, .hello = &bt_emu_hello, .send = answer, .fill = fill};
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
    sampled_behind_the_end =
        sampled_behind_the_end || (channel != BT_EMU_LINE && bt_emu_stream_lacks(&stream, t_ns));
    return bt_emu_stream_by_clock(context, finger, channel, t_ns);
}

static void plug_all_in(void)
{
    bt_emu_bus_init(&bus, stream.fingers, serials, count, &stream);
}

// Plug in: 0, or the address of an error message about the tape at room().
EXPORT("plug_in") const char *plug_in(uint32_t bytes)
{
    const char *wrong = bt_emu_stream_open(&stream, &__heap_base, bytes);
    if (wrong == NULL) {
        plug_all_in();
    }
    return wrong;
}

// Plug in so many fingers, which a program feeds through a ring at room(), of so many samples.
EXPORT("plug_in_live") void plug_in_live(uint32_t fingers, uint32_t samples)
{
    bt_emu_stream_init(&stream, (uint16_t *)(void *)&__heap_base, samples);
    (void)bt_emu_stream_put(&stream, (uint8_t)fingers, NULL, 0);
    plug_all_in();
}

// Another program feeds from here on.
EXPORT("feed_begin") void feed_begin(void)
{
    bt_emu_feed_begin(&feed);
}

// Where a program's bytes are put, FED_BYTES at the most, and how many came.
EXPORT("fed") uint8_t *fed(void)
{
    static uint8_t bytes[FED_BYTES];
    return bytes;
}

EXPORT("feed") void feed_bytes(uint32_t bytes)
{
    bt_emu_feed_receive(&feed, fed(), bytes);
}

EXPORT("report") void report(void)
{
    bt_emu_feed_report(&feed);
}

// When time has to stand still for want of the next round, in ns.
EXPORT("lacks_at") double lacks_at(void)
{
    return (double)bt_emu_stream_lacks_at_ns(&stream);
}

EXPORT("rounds") uint32_t rounds(void)
{
    return stream.written / BT_SLOTS;
}

// Power lost and back: the sensors forget requests, the world they feel goes on.
EXPORT("power_cycle") void power_cycle(void)
{
    plug_all_in();
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
    return stream.started;
}

EXPORT("over") int over(void)
{
    return sampled_behind_the_end;
}

EXPORT("early_reads") uint32_t early_reads(uint32_t finger)
{
    return bus.sensor[finger].early_reads;
}
