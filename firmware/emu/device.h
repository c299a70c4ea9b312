// One emulated BioTac as its SPI bus sees it: chip select edges and 16-bit transfers in, words out.
//
// Written against the data sheet's rules, not against the driver: it refuses a read that comes
// earlier than 50 us after the sample command's chip select edge, never answers twice with one
// sample, checks command parity, and answers property reads. Where the counts come from is a
// function; faults are counts too, see enum bt_emu_fault.
// Times are ns since the emulation began.
#ifndef BIOTAC_EMU_DEVICE_H
#define BIOTAC_EMU_DEVICE_H

#include <stdbool.h>
#include <stdint.h>

// What a source may return instead of 0..4095: the fault of this one sample.
enum bt_emu_fault {
    BT_EMU_TOO_EARLY = 0xFFFB,  // answers as if the 50 us had not passed
    BT_EMU_STUCK_HIGH = 0xFFFC, // MISO high throughout
    BT_EMU_STUCK_LOW = 0xFFFD,  // MISO low throughout: no sensor, or no power
    BT_EMU_BAD_PARITY = 0xFFFE, // one bit of the word flipped
    BT_EMU_NO_CHANNEL = 0xFFFF, // the sensor has no such channel
};

// Count of a channel (its number on the bus, 0..63) of one finger at a time; 0..4095 or a fault.
typedef uint16_t (*bt_emu_source)(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

typedef struct {
    bool present;
    uint8_t finger;
    char serial[17];
    bt_emu_source source;
    void *context;

    bool selected;
    uint8_t transfers;    // since the chip select fell
    uint64_t released_ns; // when it last rose
    uint8_t pending;      // what the next read gives: see device.c
    uint16_t word;        // the latched sample
    uint8_t property[16];
    uint8_t property_bytes;
    uint32_t early_reads; // reads that broke the 50 us rule
} bt_emu_device;

void bt_emu_init(bt_emu_device *device, uint8_t finger, bool present, const char *serial,
                 bt_emu_source source, void *context);

void bt_emu_select(bt_emu_device *device, bool low, uint64_t t_ns);

// Returns what this device drives on MISO. Call for selected devices only.
uint16_t bt_emu_transfer16(bt_emu_device *device, uint16_t mosi, uint64_t t_ns);

#endif
