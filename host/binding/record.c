#include "record.h"

#include "wire/little_endian.h"
#include "wire/sensor_gen.h"

#include <string.h>

size_t bt_record_pack(const bt_calibration *calibration, uint8_t record[BT_RECORD_MAX_BYTES])
{
    uint8_t data[BT_CALIBRATION_RECORD_BYTES];
    size_t bytes = bt_calibration_pack(calibration, data);
    bt_storage_make_page(record, BT_RECORD_CALIBRATION, BT_CALIBRATION_RECORD_VERSION, data, bytes);
    return BT_STORAGE_HEADER_BYTES + bytes;
}

int bt_record_unpack(bt_calibration *calibration, const uint8_t *record, size_t bytes)
{
    uint8_t page[BT_FLASH_PAGE_BYTES];
    memset(calibration, 0, sizeof *calibration);
    memset(page, 0xFF, sizeof page);
    memcpy(page, record, bytes < sizeof page ? bytes : sizeof page);
    uint16_t id = bt_get_u16(page + 4);
    uint16_t version = bt_get_u16(page + 6);
    if (!bt_storage_page_is(page, id)) {
        return BT_RECORD_DAMAGED;
    }
    if (id < BT_RECORD_CALIBRATION || id >= BT_RECORD_CALIBRATION + BT_MAX_FINGERS) {
        return BT_RECORD_OF_SOMETHING;
    }
    if (version != BT_CALIBRATION_RECORD_VERSION) {
        return BT_RECORD_OTHER_VERSION;
    }
    size_t size = bt_get_u32(page + 8);
    bt_calibration_unpack(calibration, version, page + BT_STORAGE_HEADER_BYTES, size);
    return calibration->present ? BT_RECORD_GOOD : size == 0 ? BT_RECORD_CLEARED : BT_RECORD_OUT_OF_RANGE;
}
