#include "device.h"

#include "wire/sensor_gen.h"

#include <string.h>

enum pending {
    NOTHING,  // nothing was asked for, or its answer was already taken
    SAMPLE,   // word holds a sample that settles until released_ns + 50 us
    PROPERTY, // property bytes
    REFUSAL,  // word holds an error word, under the same 50 us
};

static unsigned ones(uint8_t byte)
{
    unsigned n = 0;
    for (; byte != 0; byte = (uint8_t)(byte & (byte - 1))) {
        n++;
    }
    return n;
}

static uint8_t with_odd_parity(uint8_t byte)
{
    return (uint8_t)(byte | (ones(byte) % 2 == 0));
}

static uint16_t data_word(uint16_t count)
{
    uint8_t high = with_odd_parity((uint8_t)(count >> 5 << 1));
    uint8_t low = with_odd_parity((uint8_t)((count & 31) << 3));
    return (uint16_t)(high << 8 | low);
}

void bt_emu_init(bt_emu_device *device, uint8_t finger, bool present, const char *serial,
                 bt_emu_source source, void *context)
{
    memset(device, 0, sizeof *device);
    device->present = present;
    device->finger = finger;
    device->source = source;
    device->context = context;
    strncpy(device->serial, serial, sizeof device->serial - 1);
}

void bt_emu_select(bt_emu_device *device, bool low, uint64_t t_ns)
{
    if (device->selected && !low) {
        device->released_ns = t_ns;
    }
    if (low && !device->selected) {
        device->transfers = 0;
    }
    device->selected = low;
}

static void latch_sample(bt_emu_device *device, uint8_t channel, uint64_t t_ns)
{
    uint16_t count = device->source(device->context, device->finger, channel, t_ns);
    device->pending = SAMPLE;
    switch (count) {
    case BT_EMU_NO_CHANNEL:
        device->word = BT_ERROR_WORD_NO_CHANNEL;
        break;
    case BT_EMU_BAD_PARITY:
        device->word = data_word(2048) ^ 0x0010;
        break;
    case BT_EMU_STUCK_LOW:
        device->word = 0x0000;
        break;
    case BT_EMU_STUCK_HIGH:
        device->word = 0xFFFF;
        break;
    case BT_EMU_TOO_EARLY:
        device->word = BT_ERROR_WORD_SAMPLING_DELAY;
        break;
    default:
        device->word = data_word(count & BT_FULL_SCALE_COUNT);
        break;
    }
}

static void put_number(bt_emu_device *device, uint16_t value)
{
    device->property[0] = (uint8_t)(value >> 8);
    device->property[1] = (uint8_t)value;
    device->property_bytes = 2;
}

static void put_text(bt_emu_device *device, const char *text)
{
    size_t bytes = strlen(text);
    memcpy(device->property, text, bytes);
    device->property_bytes = (uint8_t)bytes;
}

static void look_up_property(bt_emu_device *device, uint8_t selector)
{
    device->pending = PROPERTY;
    device->property_bytes = 0;
    switch (selector) {
    case BT_PROPERTY_FLEX_VERSION:
        put_text(device, "BD");
        break;
    case BT_PROPERTY_SOFTWARE_VERSION:
        put_text(device, "0301");
        break;
    case BT_PROPERTY_SERIAL:
        put_text(device, device->serial);
        break;
    case BT_PROPERTY_CPU_SPEED:
        put_number(device, 16000);
        break;
    case BT_PROPERTY_SAMPLING_HZ:
        put_number(device, BT_SLOT_HZ);
        break;
    default:
        device->pending = REFUSAL;
        device->word = BT_ERROR_WORD_UNKNOWN_COMMAND;
        break;
    }
}

static void take_command(bt_emu_device *device, uint16_t mosi, uint64_t t_ns)
{
    uint8_t command = (uint8_t)(mosi >> 8);
    if (command & 0x80) {
        if (ones(command) % 2 == 1) {
            latch_sample(device, (uint8_t)((command & 0x7E) >> 1), t_ns);
        } else {
            device->pending = REFUSAL;
            device->word = BT_ERROR_WORD_COMMAND_PARITY;
        }
    } else if (command == BT_PROPERTY_READ_COMMAND) {
        look_up_property(device, (uint8_t)mosi);
    } else {
        device->pending = REFUSAL;
        device->word = BT_ERROR_WORD_UNKNOWN_COMMAND;
    }
}

static uint16_t property_word(bt_emu_device *device)
{
    // Bytes after the text's end read as zero.
    uint16_t word = 0;
    for (int k = 0; k < 2; k++) {
        uint8_t byte = device->property_bytes > 0 ? device->property[0] : 0;
        word = (uint16_t)(word << 8 | byte);
        if (device->property_bytes > 0) {
            device->property_bytes--;
            memmove(device->property, device->property + 1, device->property_bytes);
        }
    }
    return word;
}

static uint16_t answer(bt_emu_device *device, uint64_t t_ns)
{
    bool first = device->transfers == 0;
    bool early = first && t_ns - device->released_ns < BT_SETTLE_US * 1000ull;
    if (early && device->pending != NOTHING) {
        device->early_reads++;
        return device->pending == PROPERTY ? BT_ERROR_WORD_DELAY : BT_ERROR_WORD_SAMPLING_DELAY;
    }
    switch (device->pending) {
    case SAMPLE:
    case REFUSAL:
        // One sample is given once: a driver that reads without sampling must not see old data.
        device->pending = NOTHING;
        return device->word;
    case PROPERTY:
        return property_word(device);
    default:
        return BT_ERROR_WORD_NO_DATA;
    }
}

uint16_t bt_emu_transfer16(bt_emu_device *device, uint16_t mosi, uint64_t t_ns)
{
    if (!device->present) {
        return 0x0000;
    }
    uint16_t miso;
    if (mosi == BT_LISTEN_WORD || mosi == 0) {
        miso = answer(device, t_ns);
    } else {
        miso = 0;
        take_command(device, mosi, t_ns);
    }
    device->transfers++;
    return miso;
}
