#include "device.h"

#include "wire/sensor_gen.h"

#include <string.h>

enum pending {
    NOTHING, // no request, or the answer was read
    SAMPLE,  // word holds a sample, once it has settled
    PROPERTY,
    REFUSAL, // word holds an error word
};

static bool has_odd_parity(unsigned byte)
{
    byte ^= byte >> 4;
    byte ^= byte >> 2;
    return (byte ^ byte >> 1) & 1;
}

static uint8_t with_odd_parity(uint8_t byte)
{
    return has_odd_parity(byte) ? byte : byte | 1;
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
    memcpy(device->serial, "BTEMU00000000001", sizeof device->serial);
    device->serial[sizeof device->serial - 2] = (char)('1' + finger);
    const size_t bytes = strcspn(serial, "/");
    if (bytes != 0) {
        memset(device->serial, 0, sizeof device->serial);
        memcpy(device->serial, serial, bytes < sizeof device->serial ? bytes : sizeof device->serial - 1);
    }
    device->kind = (uint8_t)(serial[bytes] == '\0' ? BT_EMU_ANY : serial[bytes + 1]);
}

// Unplugged and so without power: the request is lost.
static void power_off(bt_emu_device *device, bool swapped)
{
    device->pending = NOTHING;
    device->has_last = false;
    device->mute = true;
    if (!device->unplugged && swapped && device->serial[0] != '\0') {
        char *mark = &device->serial[strlen(device->serial) - 1];
        *mark = *mark == 'X' ? 'Y' : 'X';
    }
    device->unplugged = true;
}

// The line's present fault, or 0.
static uint16_t line_fault(bt_emu_device *device, uint16_t word)
{
    if (word == BT_EMU_FAULT_SWAPPED || word == BT_EMU_FAULT_UNPLUGGED) {
        power_off(device, word == BT_EMU_FAULT_SWAPPED);
        return BT_EMU_FAULT_UNPLUGGED;
    }
    device->unplugged = false;
    return word > BT_FULL_SCALE_COUNT ? word : 0;
}

static uint16_t line_now(bt_emu_device *device, uint64_t t_ns)
{
    return line_fault(device, device->source(device->context, device->finger, BT_EMU_LINE, t_ns));
}

static void latch_sample(bt_emu_device *device, uint8_t channel, uint64_t t_ns)
{
    uint16_t count = device->source(device->context, device->finger, channel, t_ns);
    device->pending = SAMPLE;
    switch (line_fault(device, count)) {
    case BT_EMU_FAULT_NO_CHANNEL:
        device->word = BT_ERROR_WORD_NO_CHANNEL;
        break;
    case BT_EMU_FAULT_BAD_PARITY:
        device->word = data_word(2048) ^ 0x0010;
        break;
    case BT_EMU_FAULT_UNPLUGGED:
    case BT_EMU_FAULT_STUCK_LOW:
        device->word = 0x0000;
        break;
    case BT_EMU_FAULT_STUCK_HIGH:
        device->word = 0xFFFF;
        break;
    case BT_EMU_FAULT_TOO_EARLY:
        device->word = BT_ERROR_WORD_SAMPLING_DELAY;
        break;
    default:
        device->word = device->mute ? 0x0000 : data_word(count & BT_FULL_SCALE_COUNT);
        break;
    }
    device->last_word = device->word;
    device->has_last = true;
}

static void resend(bt_emu_device *device)
{
    device->pending = device->has_last ? SAMPLE : REFUSAL;
    device->word = device->has_last ? device->last_word : BT_ERROR_WORD_NO_DATA;
}

static void refuse(bt_emu_device *device, uint16_t word)
{
    device->pending = REFUSAL;
    device->word = word;
}

// ---- properties -------------------------------------------------------------------------------------

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

static void put_pattern(bt_emu_device *device)
{
    for (int slot = 0; slot < BT_SLOTS; slot++) {
        device->property[2 * slot] = bt_channel_command[bt_slot_channel[slot]];
        device->property[2 * slot + 1] = slot == BT_SLOTS - 1 ? 0xFE : 0x01;
    }
    device->property_bytes = 2 * BT_SLOTS;
}

static void look_up_property(bt_emu_device *device, uint8_t selector, uint64_t t_ns)
{
    if (line_now(device, t_ns) == BT_EMU_FAULT_UNPLUGGED) {
        return;
    }
    device->pending = PROPERTY;
    device->property_at = 0;
    device->mute = false;
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
    case BT_PROPERTY_SAMPLING_PATTERN:
        put_pattern(device);
        break;
    default:
        refuse(device, BT_ERROR_WORD_UNKNOWN_COMMAND);
        break;
    }
}

// ---- the shift register -----------------------------------------------------------------------------

// A byte that is not a sample's, as the line's fault changes it; low: the second byte of two.
static uint8_t on_the_line(uint8_t byte, uint16_t fault, bool low)
{
    switch (fault) {
    case BT_EMU_FAULT_NONE:
        return byte;
    case BT_EMU_FAULT_STUCK_HIGH:
        return 0xFF;
    case BT_EMU_FAULT_BAD_PARITY:
        return byte ^ 0x10;
    case BT_EMU_FAULT_TOO_EARLY:
        return (uint8_t)(BT_ERROR_WORD_DELAY >> (low ? 0 : 8));
    case BT_EMU_FAULT_NO_CHANNEL:
        return (uint8_t)(BT_ERROR_WORD_NO_CHANNEL >> (low ? 0 : 8));
    default:
        return 0x00;
    }
}

// The next two bytes, unless they are a property's.
static uint16_t word_now(const bt_emu_device *device, bool settled)
{
    if (device->pending == NOTHING) {
        return device->unplugged ? 0x0000 : BT_ERROR_WORD_NO_DATA;
    }
    if (!settled) {
        return device->pending == SAMPLE ? BT_ERROR_WORD_SAMPLING_DELAY : BT_ERROR_WORD_DELAY;
    }
    return device->word;
}

// Chosen when the first of the two bytes begins; both then count as read.
static uint16_t answer(bt_emu_device *device)
{
    uint16_t word = word_now(device, device->settled);
    if (device->settled) {
        device->pending = NOTHING;
    }
    return word;
}

static uint8_t property_byte(const bt_emu_device *device, unsigned at)
{
    return at < device->property_bytes ? device->property[at] : 0;
}

static uint8_t shift_out(bt_emu_device *device, uint64_t t_ns)
{
    bool low = device->position & 1;
    if (device->pending == PROPERTY && device->settled) {
        if (device->kind == BT_EMU_BYTES && device->position != 0) {
            return 0x00;
        }
        uint8_t byte = property_byte(device, device->property_at);
        device->property_at = (uint8_t)(device->property_at + (device->property_at < device->property_bytes));
        return on_the_line(byte, line_now(device, t_ns), low);
    }
    if (!low) {
        uint16_t word = answer(device);
        device->out[0] = (uint8_t)(word >> 8);
        device->out[1] = (uint8_t)word;
    }
    return device->out[low];
}

uint16_t bt_emu_word_ahead(const bt_emu_device *device, unsigned bytes, bool settled, uint64_t t_ns)
{
    if (!device->present) {
        return 0x0000;
    }
    if (device->pending != PROPERTY || !settled) {
        return word_now(device, settled);
    }
    uint16_t word = device->source(device->context, device->finger, BT_EMU_LINE, t_ns);
    uint16_t fault = word > BT_FULL_SCALE_COUNT ? word : BT_EMU_FAULT_NONE;
    unsigned at = device->property_at + bytes;
    uint8_t high = on_the_line(property_byte(device, at), fault, false);
    return (uint16_t)(high << 8 | on_the_line(property_byte(device, at + 1), fault, true));
}

static void receive_first_byte(bt_emu_device *device, uint8_t mosi, uint64_t t_ns)
{
    device->command = mosi;
    if (mosi == BT_LISTEN_WORD >> 8) {
        device->early_reads += device->pending != NOTHING && !device->settled;
        return;
    }
    device->settled = false;
    if (mosi & 0x80) {
        if (has_odd_parity(mosi)) {
            latch_sample(device, BT_EMU_CHANNEL(mosi), t_ns);
        } else {
            refuse(device, BT_ERROR_WORD_COMMAND_PARITY);
        }
    } else if (mosi == BT_RESEND_COMMAND_1 || mosi == BT_RESEND_COMMAND_2) {
        resend(device);
    } else if (mosi == BT_PROPERTY_WRITE_COMMAND) {
        refuse(device, BT_ERROR_WORD_READ_ONLY);
    } else {
        refuse(device, BT_ERROR_WORD_UNKNOWN_COMMAND);
    }
}

void bt_emu_select(bt_emu_device *device, bool low, uint64_t t_ns)
{
    if (device->selected && !low) {
        device->released_ns = t_ns;
        const bool ends =
            device->kind == BT_EMU_HELD || (device->kind == BT_EMU_WORDS && device->position & 1);
        if (ends && device->pending == PROPERTY && device->property_at != 0) {
            device->pending = NOTHING;
        }
    }
    if (low && !device->selected) {
        device->position = 0;
        // An answer needs the 50 us once, not for every byte.
        device->settled = device->settled || t_ns - device->released_ns >= BT_SETTLE_US * 1000ull;
    }
    device->selected = low;
}

uint8_t bt_emu_transfer8(bt_emu_device *device, uint8_t mosi, uint64_t t_ns)
{
    if (!device->present) {
        return 0x00;
    }
    // The first bit goes out before the master's first comes in.
    uint8_t miso = shift_out(device, t_ns);
    if (device->position % 2 == 0) {
        receive_first_byte(device, mosi, t_ns);
    } else if (device->command == BT_PROPERTY_READ_COMMAND) {
        look_up_property(device, mosi, t_ns);
    }
    device->position++;
    return miso;
}
