#include "properties.h"

#include "wire/sensor_gen.h"

#include <string.h>

#define TRIES          3
#define ASKS           6 // at start, in all forms
#define ERROR_HIGH     (BT_ERROR_WORD_UNKNOWN_COMMAND >> 8)
#define VERSION_BYTES  4
#define READS_IN(form) ((form) == BT_FORM_BYTES ? 3 : 4)
_Static_assert(4 + VERSION_BYTES / 2 + 3 * BT_SERIAL_BYTES / 2 <= BT_SLOTS
                   && 3 + VERSION_BYTES + 2 * BT_SERIAL_BYTES <= BT_SLOTS,
               "one round must suffice to ask in each form");

// Sends the command, or reads the next part: a word, a byte or, with the select held, two. True once all are
// there.
static bool step(bt_property *property, bt_port *port, uint8_t finger)
{
    port_spi_select(port, (uint8_t)(1u << finger));
    if (!property->asked) {
        property->asked = true;
        (void)port_spi_transfer16(port, (uint16_t)(BT_PROPERTY_READ_COMMAND << 8 | property->selector));
    } else if (property->form == BT_FORM_WORDS) {
        const uint16_t word = port_spi_transfer16(port, BT_LISTEN_WORD);
        property->got[property->at++] = (uint8_t)(word >> 8);
        property->got[property->at++] = (uint8_t)word;
    } else {
        property->got[property->at++] = port_spi_transfer8(port, BT_LISTEN_WORD >> 8);
        if (property->form == BT_FORM_HELD) {
            port_delay_us(port, BT_PROPERTY_GAP_US);
            property->got[property->at++] = port_spi_transfer8(port, BT_LISTEN_WORD >> 8);
        }
    }
    const bool whole = property->at == property->bytes;
    if (property->form != BT_FORM_HELD || property->at == 0 || whole) {
        port_spi_select(port, 0);
    }
    return whole;
}

// ---- identification ---------------------------------------------------------------------------------

static bt_property begin(uint8_t selector, size_t bytes, uint8_t form)
{
    return (bt_property){.selector = selector, .bytes = (uint8_t)bytes, .form = form};
}

void bt_serial_query_begin(bt_serial_query *query)
{
    query->whole = 0;
    query->read[0] = begin(BT_PROPERTY_SOFTWARE_VERSION, VERSION_BYTES, query->form);
    query->read[1] = begin(BT_PROPERTY_SERIAL, BT_SERIAL_BYTES, query->form);
    query->read[2] = query->read[3] = query->read[1];
}

void bt_serial_query_step(bt_serial_query *query, bt_port *port, uint8_t finger)
{
    if (query->whole < READS_IN(query->form) && step(&query->read[query->whole], port, finger)) {
        query->whole++;
    }
}

// ---- valid properties -------------------------------------------------------------------------------

// 0x00 and 0xFF end a text (CLIB); later bytes are cut off. Returns false if it is not a text.
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

// BT2P0220B11E0004 and BTSP050400018017 are known; both have digits here.
static bool trim_serial(uint8_t serial[BT_SERIAL_BYTES])
{
    return trim_text(serial, BT_SERIAL_BYTES) && memcmp(serial, "BT", 2) == 0
           && (uint8_t)(serial[5] - '0') < 10 && (uint8_t)(serial[6] - '0') < 10
           && (uint8_t)(serial[7] - '0') < 10;
}

#define PATIENCE    2 // rounds that a form may fail in which the sensor has answered
#define HELD_ROUNDS 6 // a round with the select held low costs the other fingers theirs

bool bt_serial_query_answer(bt_serial_query *query, uint8_t serial[BT_SERIAL_BYTES])
{
    query->driven = (uint8_t)(query->read[1].got[0] + 1) > 1; // neither 0x00 nor 0xFF
    for (int k = 1; k < query->whole; k++) {
        uint8_t *got = query->read[k].got;
        if (trim_serial(got)) {
            const bool same = memcmp(query->serial, got, BT_SERIAL_BYTES) == 0;
            memcpy(query->serial, got, BT_SERIAL_BYTES);
            query->readings = (uint8_t)(same ? query->readings + 1 : 1);
            query->forms = (uint8_t)((same ? query->forms : 0) | 1u << query->form);
        }
    }
    const bool sure = query->readings >= 3 || query->forms & (query->forms - 1);
    if (sure) {
        query->readings = query->forms = query->held = 0;
        query->patience = PATIENCE;
    } else if (query->driven && query->patience != 0) {
        query->patience--;
    } else if (query->driven && !(query->forms >> query->form & 1)) {
        const bool hold = query->form == BT_FORM_WORDS && query->held < HELD_ROUNDS;
        query->held = (uint8_t)(query->held + hold);
        query->form = hold ? BT_FORM_HELD : query->form == BT_FORM_BYTES ? BT_FORM_WORDS : BT_FORM_BYTES;
    }
    memcpy(serial, query->serial, BT_SERIAL_BYTES);
    return sure;
}

// ---- all of them ------------------------------------------------------------------------------------

static void pause(bt_port *port, const bt_property *property)
{
    const bool settles = property->at == 0 || property->form == BT_FORM_HELD;
    port_delay_us(port, (settles ? BT_SETTLE_US : BT_PROPERTY_GAP_US) + 1);
}

static bool read_alike(bt_port *port, uint8_t finger, uint8_t form, uint8_t selector, uint8_t *out,
                       size_t bytes)
{
    bt_property read[2];
    for (int k = 0; k < TRIES; k++) {
        for (int n = 0; n < 2; n++) {
            read[n] = begin(selector, bytes, form);
            for (bool whole = false; !whole; pause(port, &read[n])) {
                whole = step(&read[n], port, finger);
            }
        }
        const uint8_t *got = read[0].got;
        if (memcmp(got, read[1].got, bytes) == 0 && got[0] != ERROR_HIGH && got[0] != 0xFF) {
            memcpy(out, got, bytes);
            return true;
        }
    }
    memset(out, 0, bytes);
    return false;
}

static void read_text(bt_port *port, uint8_t finger, uint8_t form, uint8_t selector, uint8_t *out,
                      size_t bytes)
{
    if (!read_alike(port, finger, form, selector, out, bytes) || !trim_text(out, (unsigned)bytes)) {
        memset(out, 0, bytes);
    }
}

static uint16_t read_number(bt_port *port, uint8_t finger, uint8_t form, uint8_t selector)
{
    uint8_t bytes[2];
    (void)read_alike(port, finger, form, selector, bytes, sizeof bytes);
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

void bt_properties_read(bt_port *port, uint8_t finger, bt_serial_query *query, bt_msg_sensor_info *info)
{
    memset(info, 0, sizeof *info);
    info->finger = finger;
    for (int k = 0; k < ASKS && query->patience == 0 && (k == 0 || query->driven); k++) {
        bt_serial_query_begin(query);
        while (query->whole < READS_IN(query->form)) {
            const bt_property *read = &query->read[query->whole];
            bt_serial_query_step(query, port, finger);
            pause(port, read);
        }
        info->present = bt_serial_query_answer(query, info->serial) && !bt_serial_is_foreign(info->serial);
    }
    if (!info->present) {
        memset(info->serial, 0, query->patience == 0 ? sizeof info->serial : 0); // another type's is reported
        return;
    }
    uint8_t form = query->form;
    read_text(port, finger, form, BT_PROPERTY_SOFTWARE_VERSION, info->software_version,
              sizeof info->software_version);
    read_text(port, finger, form, BT_PROPERTY_FLEX_VERSION, info->flex_version, sizeof info->flex_version);
    info->cpu_khz = read_number(port, finger, form, BT_PROPERTY_CPU_SPEED);
    info->sampling_hz = read_number(port, finger, form, BT_PROPERTY_SAMPLING_HZ);
}
