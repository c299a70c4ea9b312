// The calibration of one finger: values of its own for the settings that link.toml marks per_finger, made for
// one sensor.
#ifndef BIOTAC_CALIBRATION_H
#define BIOTAC_CALIBRATION_H

#include "keep/settings.h"

#include <stdbool.h>

#define BT_SERIAL_BYTES 16

typedef struct {
    bool present;
    bool unsaved;                    // set or cleared since it was stored
    uint8_t serial[BT_SERIAL_BYTES]; // of the sensor it was made for; all zero: any sensor
    uint32_t made_s;                 // since 1970 UTC; 0: unknown
    int32_t value[BT_CALIBRATION_VALUES];
} bt_calibration;

// Whether what was made for one sensor, all zero: for any, may hold for the one that told `there`; all zero
// when none has.
bool bt_serial_fits(const uint8_t made_for[BT_SERIAL_BYTES], const uint8_t there[BT_SERIAL_BYTES]);

// Its values in place of the settings'. Returns an enum bt_error: OK or, with the rest left as it was,
// OUT_OF_RANGE.
uint8_t bt_calibration_apply(const bt_calibration *calibration, bt_settings *settings);

// As a stored record, little-endian: u8 serial[16], u32 made_s, i32 value[8]. A cleared one is a record of no
// bytes. A model with more to it becomes another version: 1 ended before pressure_gain_nn, which then is not
// calibrated.
#define BT_CALIBRATION_RECORD_VERSION 2
#define BT_CALIBRATION_RECORD_BYTES   (BT_SERIAL_BYTES + 4 + 4 * BT_CALIBRATION_VALUES)

// Returns the record's size.
size_t bt_calibration_pack(const bt_calibration *calibration, uint8_t record[BT_CALIBRATION_RECORD_BYTES]);

// A record of an unknown version, of another size or with a value out of its range leaves none.
void bt_calibration_unpack(bt_calibration *calibration, uint16_t version, const uint8_t *record,
                           size_t bytes);

#endif
