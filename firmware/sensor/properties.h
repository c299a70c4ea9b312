// What a sensor says of itself.
//
// Property bytes carry no parity and no length, so each property is read twice and compared, byte by byte
// with the chip select high between bytes as every driver in use does (a PIC has to reload its shift
// register), and an error word (0xA5xx) is never taken for a value. SynTouch's library throws the first read
// after power-up away; so do we, and by it a sensor that says only zeros until it was asked something finds
// its voice.
#ifndef BIOTAC_PROPERTIES_H
#define BIOTAC_PROPERTIES_H

#include "wire/messages_gen.h"

#include <stdbool.h>
#include <stdint.h>

#define BT_SERIAL_CHARS sizeof(((bt_msg_sensor_info *)0)->serial)

// One property under way. Zeroed but for selector and bytes.
typedef struct {
    uint8_t selector; // enum bt_property
    uint8_t bytes;
    uint8_t at;
    bool asked;
    uint8_t got[BT_SERIAL_CHARS]; // no property of ours is longer
} bt_property;

// One period of the chip select: the command, then byte after byte. True when it is whole. Before the first
// byte pass BT_SETTLE_US, before each other one BT_PROPERTY_GAP_US.
bool bt_property_step(bt_property *property, uint8_t finger);

// Who is there, asked in as many steps as a round has slots at most: of the sampler's interrupt, instead of a
// sample.
typedef struct {
    bt_property read[3]; // one to throw away, and the serial number twice
    uint8_t whole;       // of them
} bt_serial_query;

void bt_serial_query_begin(bt_serial_query *query);
void bt_serial_query_step(bt_serial_query *query, uint8_t finger);

// The serial number, padded with zeros. False when it was not read twice alike, or is none of a BioTac of 19
// electrodes.
bool bt_serial_query_answer(const bt_serial_query *query, uint8_t serial[BT_SERIAL_CHARS]);

// All properties, before sampling begins: some 1.3 ms. Fills info; present is 1 when there is a serial
// number, which begins with "BT", as SynTouch's own library decides it, and is none of a BioTac of 24
// electrodes. What was not read twice alike in three tries is zero.
void bt_properties_read(uint8_t finger, bt_msg_sensor_info *info);

#endif
