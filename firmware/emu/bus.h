// One to five emulated BioTacs on one SPI bus, each with a chip select. Every rig uses this code: the posix
// board natively, the emulated microcontroller as WebAssembly.
#ifndef BIOTAC_EMU_BUS_H
#define BIOTAC_EMU_BUS_H

#include "device.h"
#include "wire/sensor_gen.h"

#include <stdint.h>

typedef struct {
    bt_emu_device sensor[BT_MAX_FINGERS];
    uint8_t selected; // bit mask of the chip selects that are low
} bt_emu_bus;

// The first `fingers` sensors are plugged in. serials: one per finger, separated by commas; a finger without
// one gets a made-up one.
void bt_emu_bus_init(bt_emu_bus *bus, uint32_t fingers, const char *serials, bt_emu_source source,
                     void *context);

// Pull low the chip selects of the sensors in mask, release all others.
void bt_emu_bus_select(bt_emu_bus *bus, uint8_t mask, uint64_t t_ns);

// Returns the bits on MISO while the master sends mosi. Several selected sensors drive it at once:
// contention.
uint8_t bt_emu_bus_transfer8(bt_emu_bus *bus, uint8_t mosi, uint64_t t_ns);
uint16_t bt_emu_bus_transfer16(bt_emu_bus *bus, uint16_t mosi, uint64_t t_ns);

#endif
