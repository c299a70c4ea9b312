// Reads what a sensor says about itself.
//
// Property bytes carry no parity and no length, so each property is read twice and compared, and an error
// word (0xA5xx) is never taken for a value. Bytes are read one at a time with the chip select high in
// between, as every driver in use does (a PIC has to reload its shift register). SynTouch's library discards
// the first read after power-up, and so do we: some sensors send only zeros until they are asked for a
// property.
#ifndef BIOTAC_PROPERTIES_H
#define BIOTAC_PROPERTIES_H

#include "port.h"
#include "wire/messages_gen.h"

#include <stdbool.h>
#include <stdint.h>

#define BT_SERIAL_CHARS sizeof(((bt_msg_sensor_info *)0)->serial)

// A property being read. Zeroed except for selector and bytes.
typedef struct {
    uint8_t selector; // enum bt_property
    uint8_t bytes;
    uint8_t at;
    bool asked;
    uint8_t got[BT_SERIAL_CHARS]; // no property that we read is longer
} bt_property;

// One chip select period: sends the command, or reads the next byte. Returns true once all bytes are there.
// Wait BT_SETTLE_US before the first byte and BT_PROPERTY_GAP_US before each other one.
bool bt_property_step(bt_property *property, bt_port *port, uint8_t finger);

// Asks for the serial number in at most as many steps as a round has slots, which the sampler's interrupt
// takes instead of samples.
typedef struct {
    bt_property read[3]; // one to discard, and the serial number twice
    uint8_t whole;       // reads completed
} bt_serial_query;

void bt_serial_query_begin(bt_serial_query *query);
void bt_serial_query_step(bt_serial_query *query, bt_port *port, uint8_t finger);

// The serial number, padded with zeros. Returns false if the two reads differ, or if it is not that of a
// BioTac with 19 electrodes.
bool bt_serial_query_answer(const bt_serial_query *query, uint8_t serial[BT_SERIAL_CHARS]);

// Read all properties into info, before sampling begins; takes some 1.3 ms. present is 1 if there is a serial
// number that begins with "BT", as SynTouch's own library requires, and is not that of a BioTac with 24
// electrodes. A property that was not read twice alike in three tries is zero.
void bt_properties_read(bt_port *port, uint8_t finger, bt_msg_sensor_info *info);

#endif
