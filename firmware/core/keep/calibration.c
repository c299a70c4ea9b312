#include "keep/calibration.h"

#include "wire/little_endian.h"

#include <string.h>

#define MADE_AT  BT_SERIAL_BYTES
#define VALUE_AT (MADE_AT + 4)

bool bt_serial_fits(const uint8_t made_for[BT_SERIAL_BYTES], const uint8_t serial[BT_SERIAL_BYTES])
{
    static const uint8_t any[BT_SERIAL_BYTES];
    return memcmp(made_for, any, sizeof any) == 0 || memcmp(made_for, serial, sizeof any) == 0;
}

uint8_t bt_calibration_apply(const bt_calibration *calibration, bt_settings *settings)
{
    for (int k = 0; k < BT_CALIBRATION_VALUES; k++) {
        uint8_t error = bt_settings_set(settings, bt_calibration_setting[k], calibration->value[k]);
        if (error != BT_ERROR_OK) {
            return error;
        }
    }
    return BT_ERROR_OK;
}

size_t bt_calibration_pack(const bt_calibration *calibration, uint8_t record[BT_CALIBRATION_RECORD_BYTES])
{
    if (!calibration->present) {
        return 0;
    }
    memcpy(record, calibration->serial, BT_SERIAL_BYTES);
    bt_put_u32(record + MADE_AT, calibration->made_s);
    for (int k = 0; k < BT_CALIBRATION_VALUES; k++) {
        bt_put_u32(record + VALUE_AT + 4 * k, (uint32_t)calibration->value[k]);
    }
    return BT_CALIBRATION_RECORD_BYTES;
}

void bt_calibration_unpack(bt_calibration *calibration, uint16_t version, const uint8_t *record, size_t bytes)
{
    bt_settings trial;
    memset(calibration, 0, sizeof *calibration);
    if (version != BT_CALIBRATION_RECORD_VERSION || bytes != BT_CALIBRATION_RECORD_BYTES) {
        return;
    }
    bt_settings_reset(&trial);
    memcpy(calibration->serial, record, BT_SERIAL_BYTES);
    calibration->made_s = bt_get_u32(record + MADE_AT);
    for (int k = 0; k < BT_CALIBRATION_VALUES; k++) {
        calibration->value[k] = (int32_t)bt_get_u32(record + VALUE_AT + 4 * k);
    }
    calibration->present = bt_calibration_apply(calibration, &trial) == BT_ERROR_OK;
}
