#include "properties.h"

#include "wire/sensor_gen.h"

#include <string.h>

#define TRIES         3
#define ERROR_HIGH    (BT_ERROR_WORD_UNKNOWN_COMMAND >> 8)
#define VERSION_BYTES 4
#define QUERY_READS   3
#define QUERY_STEPS   (1 + VERSION_BYTES + 2 * (1 + BT_SERIAL_CHARS))
_Static_assert(QUERY_STEPS <= BT_SLOTS, "one round must suffice to ask");

bool bt_property_step(bt_property *property, bt_port *port, uint8_t finger)
{
    port_spi_select(port, (uint8_t)(1u << finger));
    if (!property->asked) {
        property->asked = true;
        (void)port_spi_transfer16(port, (uint16_t)(BT_PROPERTY_READ_COMMAND << 8 | property->selector));
    } else {
        property->got[property->at++] = port_spi_transfer8(port, BT_LISTEN_WORD >> 8);
    }
    port_spi_select(port, 0);
    return property->at == property->bytes;
}

// ---- who is there -----------------------------------------------------------------------------------

static void begin(bt_property *property, uint8_t selector, uint8_t bytes)
{
    property->selector = selector;
    property->bytes = bytes;
    property->at = 0;
    property->asked = false;
}

void bt_serial_query_begin(bt_serial_query *query)
{
    query->whole = 0;
    begin(&query->read[0], BT_PROPERTY_SOFTWARE_VERSION, VERSION_BYTES);
    begin(&query->read[1], BT_PROPERTY_SERIAL, BT_SERIAL_CHARS);
    begin(&query->read[2], BT_PROPERTY_SERIAL, BT_SERIAL_CHARS);
}

void bt_serial_query_step(bt_serial_query *query, bt_port *port, uint8_t finger)
{
    if (query->whole < QUERY_READS && bt_property_step(&query->read[query->whole], port, finger)) {
        query->whole++;
    }
}

// ---- what may be taken for a property ---------------------------------------------------------------

// 0x00 and 0xFF end a text (CLIB); the rest is cut off. Returns false if it is not a text.
static bool trim_text(uint8_t *text, unsigned bytes)
{
    unsigned end = 0;
    while (end < bytes && text[end] >= 0x20 && text[end] < 0x7F) {
        end++;
    }
    bool ends = end == bytes || text[end] == 0x00 || text[end] == 0xFF;
    memset(text + end, 0, bytes - end);
    return ends && end > 0;
}

static bool trim_serial(uint8_t serial[BT_SERIAL_CHARS])
{
    return trim_text(serial, BT_SERIAL_CHARS) && memcmp(serial, "BT", 2) == 0;
}

bool bt_serial_query_answer(const bt_serial_query *query, uint8_t serial[BT_SERIAL_CHARS])
{
    memcpy(serial, query->read[1].got, BT_SERIAL_CHARS);
    return query->whole == QUERY_READS && memcmp(serial, query->read[2].got, BT_SERIAL_CHARS) == 0
           && trim_serial(serial);
}

// ---- all of them ------------------------------------------------------------------------------------

static void read_once(bt_port *port, uint8_t finger, bt_property *property, uint8_t selector, uint8_t bytes)
{
    begin(property, selector, bytes);
    while (!bt_property_step(property, port, finger)) {
        port_delay_us(port, (property->at == 0 ? BT_SETTLE_US : BT_PROPERTY_GAP_US) + 1);
    }
    port_delay_us(port, BT_PROPERTY_GAP_US + 1);
}

static bool read_alike(bt_port *port, uint8_t finger, uint8_t selector, uint8_t *out, size_t bytes)
{
    bt_property first, second;
    for (int k = 0; k < TRIES; k++) {
        read_once(port, finger, &first, selector, (uint8_t)bytes);
        read_once(port, finger, &second, selector, (uint8_t)bytes);
        if (memcmp(first.got, second.got, bytes) == 0 && first.got[0] != ERROR_HIGH && first.got[0] != 0xFF) {
            memcpy(out, first.got, bytes);
            return true;
        }
    }
    memset(out, 0, bytes);
    return false;
}

static void read_text(bt_port *port, uint8_t finger, uint8_t selector, uint8_t *out, size_t bytes)
{
    if (!read_alike(port, finger, selector, out, bytes) || !trim_text(out, (unsigned)bytes)) {
        memset(out, 0, bytes);
    }
}

static uint16_t read_number(bt_port *port, uint8_t finger, uint8_t selector)
{
    uint8_t bytes[2];
    (void)read_alike(port, finger, selector, bytes, sizeof bytes);
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

void bt_properties_read(bt_port *port, uint8_t finger, bt_msg_sensor_info *info)
{
    bt_property thrown_away;
    memset(info, 0, sizeof *info);
    info->finger = finger;
    read_once(port, finger, &thrown_away, BT_PROPERTY_SOFTWARE_VERSION, VERSION_BYTES);
    read_text(port, finger, BT_PROPERTY_SERIAL, info->serial, sizeof info->serial);
    info->present = trim_serial(info->serial) && !bt_serial_is_foreign(info->serial);
    if (!info->present) {
        return;
    }
    read_text(port, finger, BT_PROPERTY_SOFTWARE_VERSION, info->software_version,
              sizeof info->software_version);
    read_text(port, finger, BT_PROPERTY_FLEX_VERSION, info->flex_version, sizeof info->flex_version);
    info->cpu_khz = read_number(port, finger, BT_PROPERTY_CPU_SPEED);
    info->sampling_hz = read_number(port, finger, BT_PROPERTY_SAMPLING_HZ);
}
