// A calibration as the board's flash holds it, for memories that are not the board's.
#ifndef BIOTAC_RECORD_H
#define BIOTAC_RECORD_H

#include "keep/calibration.h"
#include "keep/storage.h"

#define BT_RECORD_MAX_BYTES BT_FLASH_PAGE_BYTES

enum bt_record_judgement {
    BT_RECORD_GOOD = 0,
    BT_RECORD_DAMAGED = 1,       // no whole record
    BT_RECORD_OF_SOMETHING = 2,  // whole, but no calibration
    BT_RECORD_OTHER_VERSION = 3, // a calibration, of a version that is not known here
    BT_RECORD_CLEARED = 4,       // a calibration of no bytes: there is none
    BT_RECORD_OUT_OF_RANGE = 5,
};

// Header and data into record; returns their size.
size_t bt_record_pack(const bt_calibration *calibration, uint8_t record[BT_RECORD_MAX_BYTES]);

// Bytes behind the record count if they are not 0xFF. Returns an enum bt_record_judgement; without
// BT_RECORD_GOOD the calibration is not present.
int bt_record_unpack(bt_calibration *calibration, const uint8_t *record, size_t bytes);

#endif
