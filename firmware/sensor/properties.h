// Reads a sensor's properties.
//
// Three forms of a property's bytes are documented, none seen to work: 16-bit words, one a select (SPM 8.2;
// CLIB's CPU speed), bytes with the select held (CLIB), bytes with a select each. They have no parity and no
// length: an error word (0xA5xx) is no value, each property is read twice alike, a serial number in two forms
// or three times in one. The first read is discarded, as in CLIB: some sensors send zeros until the first
// request.
#ifndef BIOTAC_PROPERTIES_H
#define BIOTAC_PROPERTIES_H

#include "port.h"
#include "wire/messages_gen.h"

#include <stdbool.h>
#include <stdint.h>

enum bt_form { BT_FORM_WORDS, BT_FORM_HELD, BT_FORM_BYTES };

// A property being read. Zeroed except for selector, bytes and form.
typedef struct {
    uint8_t selector;    // enum bt_property
    uint8_t bytes, form; // an even number; enum bt_form
    uint8_t at;
    bool asked;
    uint8_t got[BT_SERIAL_BYTES]; // no property read here is longer
} bt_property;

// Asks for the serial number in at most as many steps as a round has slots; the sampler's interrupt runs them
// instead of samples: three times, single bytes twice. The state lasts from round to round; all zeros:
// nothing known.
typedef struct {
    bt_property read[4]; // one to discard, then the serial number
    uint8_t whole;       // reads completed
    uint8_t form;        // enum bt_form of the next round
    uint8_t patience; // rounds left to fail before it counts as another sensor; 0: no answer in this form yet
    bool driven;      // in the latest round; false for an absent sensor or a stuck line
    uint8_t held;     // rounds with the select held, without an answer
    uint8_t serial[BT_SERIAL_BYTES], readings, forms; // read so far, count, and bit mask of the forms
} bt_serial_query;

void bt_serial_query_begin(bt_serial_query *query);
void bt_serial_query_step(bt_serial_query *query, bt_port *port, uint8_t finger);

// The serial number, padded with zeros, of any kind (bt_serial_is_foreign). Returns false while it is not
// sure. Call once after each round; chooses the next round's form.
bool bt_serial_query_answer(bt_serial_query *query, uint8_t serial[BT_SERIAL_BYTES]);

// Read all properties into info, before sampling begins; lasts some 1.5 ms, up to 10 for a sensor that does
// not answer by words. present is 1 for a serial number that is not of a BioTac with 24 electrodes. A
// property that was not read twice alike in three tries is zero.
void bt_properties_read(bt_port *port, uint8_t finger, bt_serial_query *query, bt_msg_sensor_info *info);

#endif
