// One finger's values for the settings that link.toml marks per_finger, made for one sensor.
#ifndef BIOTAC_CALIBRATION_H
#define BIOTAC_CALIBRATION_H

#include "keep/settings.h"

#include <stdbool.h>

typedef struct {
    bool present;
    bool unsaved;                    // set or cleared since it was stored
    uint8_t serial[BT_SERIAL_BYTES]; // of the sensor; all zero: any sensor
    uint32_t made_s;                 // since 1970 UTC; 0: unknown
    int32_t value[BT_CALIBRATION_VALUES];
} bt_calibration;

// True when a thing made for one sensor (made_for; all zero: any) fits the sensor with this serial number
// (all zero: unknown).
bool bt_serial_fits(const uint8_t made_for[BT_SERIAL_BYTES], const uint8_t serial[BT_SERIAL_BYTES]);

// Copy the calibration's values into the settings. Returns an enum bt_error: OK, or OUT_OF_RANGE with some
// copied.
uint8_t bt_calibration_apply(const bt_calibration *calibration, bt_settings *settings);

// The stored record, little-endian: u8 serial[16], u32 made_s, i32 value[8]. A cleared calibration is a
// record of no bytes. Other values make a new version.
#define BT_CALIBRATION_RECORD_VERSION 1
#define BT_CALIBRATION_RECORD_BYTES   (BT_SERIAL_BYTES + 4 + 4 * BT_CALIBRATION_VALUES)

// Returns the record's size.
size_t bt_calibration_pack(const bt_calibration *calibration, uint8_t record[BT_CALIBRATION_RECORD_BYTES]);

// A record of another version, of the wrong size or with a value out of range gives no calibration.
void bt_calibration_unpack(bt_calibration *calibration, uint16_t version, const uint8_t *record,
                           size_t bytes);

#endif
