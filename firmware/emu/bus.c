#include "bus.h"

#include <string.h>

void bt_emu_bus_init(bt_emu_bus *bus, uint32_t fingers, const char *serials, bt_emu_source source,
                     void *context)
{
    bus->selected = 0;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        char serial[BT_EMU_SERIAL_CHARS] = "";
        size_t given = strcspn(serials, ",");
        if (given < sizeof serial) {
            memcpy(serial, serials, given);
        }
        serials += given + (serials[given] == ',');
        bt_emu_init(&bus->sensor[f], f, f < fingers, serial, source, context);
    }
}

void bt_emu_bus_select(bt_emu_bus *bus, uint8_t mask, uint64_t t_ns)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_emu_select(&bus->sensor[f], mask >> f & 1, t_ns);
    }
    bus->selected = mask;
}

uint8_t bt_emu_bus_transfer8(bt_emu_bus *bus, uint8_t mosi, uint64_t t_ns)
{
    uint8_t miso = 0;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (bus->selected >> f & 1) {
            miso |= bt_emu_transfer8(&bus->sensor[f], mosi, t_ns);
        }
    }
    return miso;
}

uint16_t bt_emu_bus_transfer16(bt_emu_bus *bus, uint16_t mosi, uint64_t t_ns)
{
    uint8_t high = bt_emu_bus_transfer8(bus, (uint8_t)(mosi >> 8), t_ns);
    return (uint16_t)(high << 8 | bt_emu_bus_transfer8(bus, (uint8_t)mosi, t_ns));
}
