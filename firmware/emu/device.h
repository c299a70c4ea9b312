// One emulated BioTac on the SPI bus: chip select edges and bytes in, bytes out.
//
// Written from statements of the sensor's makers and users, not from our driver. Sources: SPM, the BioTac SP
// product manual V2; CLIB, SynTouch's C library for the Cheetah adapter.
// - The answer is in the shift register when the chip select falls, so the bits do not depend on what the
//   master sends meanwhile. A public PIC32 driver (mattmongeon/finger_force_control) listens with 0x0100,
//   CLIB with 0x0000, SPM asks for 0x0001, and all of them have read real sensors.
// - An answer needs 50 us with the chip select high (SPM 8.2, CLIB, PIC32). Until then, and as long as it
//   stays low, there are error words: 0xA52D after a sample command, 0xA52E after any other (SPM, CLIB).
// - A sample is given once; resend (SPM 0x50, CLIB 0x20) gives the last two bytes again, or 0xA55F (CLIB).
// - Write (0x40) answers 0xA552, read-only: SPM documents no writable variable. Property 0x73 is the list of
//   channels as pairs of command and 0x01; the last pair's second byte is 0xFE (SPM 8.4).
// - Property bytes have no parity. They go on from chip select to chip select until the next command (CLIB
//   reads them one by one); zeros follow the last one.
// - `mute`: some sensors "sent all zeroes" until a property had been read (users of CLIB). Here they do so
//   when power comes back.
// - A real sensor's answer to an unrequested read is unknown. Here it is 0xA55F, so that old data is never
//   read as new.
//
// Counts come from a function, which may also return faults: enum bt_emu_fault of the wire. Times are ns
// since the emulation began.
#ifndef BIOTAC_EMU_DEVICE_H
#define BIOTAC_EMU_DEVICE_H

#include "fault_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// The channel number of the line, passed to a source when no sample is read; it returns 0 or the present
// fault.
#define BT_EMU_LINE 64

// The channel number, on the bus, in a sample command.
#define BT_EMU_CHANNEL(command) ((uint8_t)(((command) & 0x7E) >> 1))

// The count of one finger's channel (a number on the bus, 0..63) at a time; 0..4095 or an enum bt_emu_fault.
typedef uint16_t (*bt_emu_source)(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

// The order of a property's bytes (properties.h), by the first letter of a suffix: "BT.../words".
enum bt_emu_kind {
    BT_EMU_ANY,         // from select to select, one or several in each
    BT_EMU_WORDS = 'w', // a property ends when the chip select rises within a word
    BT_EMU_HELD = 'h',  // it ends when the chip select rises
    BT_EMU_BYTES = 'b', // one a select; zeros follow
};

#define BT_EMU_PROPERTY_BYTES (2 * BT_SLOTS) // the list of channels

typedef struct {
    bool present;
    bool mute; // sends only zeros until the first request for a property
    uint8_t finger;
    uint8_t kind; // enum bt_emu_kind
    char serial[17];
    bt_emu_source source;
    void *context;

    bool selected;
    bool unplugged;
    uint8_t position;     // bytes since the chip select fell
    uint8_t command;      // the first of them
    uint8_t out[2];       // the bytes shifted out
    uint64_t released_ns; // when the chip select last rose
    uint8_t pending;      // the next read's answer: see device.c
    bool settled;         // the answer has had 50 us
    uint16_t word;        // the latched sample
    uint16_t last_word;   // for resend
    bool has_last;
    uint8_t property[BT_EMU_PROPERTY_BYTES];
    uint8_t property_bytes;
    uint8_t property_at;
    uint32_t early_reads; // reads that broke the 50 us rule
} bt_emu_device;

// serial: up to 16 characters, and a kind's suffix; empty: a made-up one.
#define BT_EMU_SERIAL_CHARS 24
void bt_emu_init(bt_emu_device *device, uint8_t finger, bool present, const char *serial,
                 bt_emu_source source, void *context);

void bt_emu_select(bt_emu_device *device, bool low, uint64_t t_ns);

// Returns this device's bits on MISO. Call for selected devices only. A word is two bytes, MSB first.
uint8_t bt_emu_transfer8(bt_emu_device *device, uint8_t mosi, uint64_t t_ns);

// The two bytes that the device would send if selected now, for any MOSI. settled: the 50 us are over. bytes:
// distance from the next one in a property.
uint16_t bt_emu_word_ahead(const bt_emu_device *device, unsigned bytes, bool settled, uint64_t t_ns);

#endif
