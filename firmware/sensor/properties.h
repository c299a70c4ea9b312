// Reads what a sensor says about itself.
//
// Three ways for a property's bytes to come are documented, none seen to work: 16-bit words, one a select
// (SPM 8.2; CLIB's CPU speed), bytes with the select held (CLIB), bytes with a select each. They have no
// parity and no length: an error word (0xA5xx) is no value, each property is read twice alike, a serial
// number in two forms or three times in one. The first read is thrown away, as CLIB does: some send zeros
// until they are asked.
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
    uint8_t got[BT_SERIAL_BYTES]; // no property that we read is longer
} bt_property;

// Asks for the serial number in at most as many steps as a round has slots, which the sampler's interrupt
// takes instead of samples: three times, single bytes twice. What is known of the sensor stays from
// round to round; all zeros: nothing.
typedef struct {
    bt_property read[4]; // one to discard, then the serial number
    uint8_t whole;       // reads completed
    uint8_t form;        // enum bt_form: the next round's
    uint8_t patience;    // rounds that may fail before it is another; 0: the sensor has never answered in it
    bool driven;         // in the latest round; not, where nobody is there or the line is stuck
    uint8_t held;        // rounds with the select held, without an answer
    uint8_t serial[BT_SERIAL_BYTES], readings, forms; // read so far, how often, and bit mask of the forms
} bt_serial_query;

void bt_serial_query_begin(bt_serial_query *query);
void bt_serial_query_step(bt_serial_query *query, bt_port *port, uint8_t finger);

// The serial number, padded with zeros, of whatever kind (bt_serial_is_foreign). Returns false if it is not
// sure yet. Once after each round; chooses the next one's form.
bool bt_serial_query_answer(bt_serial_query *query, uint8_t serial[BT_SERIAL_BYTES]);

// Read all properties into info, before sampling begins; takes some 1.5 ms, and up to 10 of a sensor that
// answers otherwise than by words. present is 1 if there is a serial number, and it is not that of a BioTac
// with 24 electrodes. A property that was not read twice alike in three tries is zero.
void bt_properties_read(bt_port *port, uint8_t finger, bt_serial_query *query, bt_msg_sensor_info *info);

#endif
