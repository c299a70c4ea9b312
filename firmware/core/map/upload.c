#include "map/upload.h"

#include <string.h>

_Static_assert(BT_MAP_MAX_BYTES / BT_FLASH_SECTOR_BYTES <= 32, "a bit for every sector of a slot");
_Static_assert(BT_FLASH_PAGE_BYTES % BT_MAP_PART_BYTES == 0, "a part lies in one page");
_Static_assert(BT_MAP_PARTS % 8 == 0, "the parts' bits fill their bytes");
_Static_assert(BT_MAP_PART_BYTES == sizeof(((bt_msg_map_data *)NULL)->data), "parts must be read as written");

static bool is_written(const bt_upload *upload, size_t part)
{
    return upload->written[part / 8] >> part % 8 & 1;
}

uint8_t bt_upload_write(bt_upload *upload, const bt_map_flash *maps, uint16_t offset,
                        const uint8_t data[BT_MAP_PART_BYTES])
{
    const bt_flash *flash = maps->flash;
    uint8_t page[BT_FLASH_PAGE_BYTES];
    const uint16_t size = upload->place.bytes;
    const size_t part = offset / BT_MAP_PART_BYTES;
    const uint32_t sector = 1u << offset / flash->sector_bytes;
    if (offset % BT_MAP_PART_BYTES != 0 || offset >= size) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    const size_t bytes =
        (size_t)(size - offset) < BT_MAP_PART_BYTES ? (size_t)(size - offset) : BT_MAP_PART_BYTES;
    const uint8_t *stored = bt_map_bytes(maps, &upload->place) + offset;
    if (is_written(upload, part)) { // the reply was lost, or another host writes too
        return memcmp(stored, data, bytes) == 0 ? BT_ERROR_OK : BT_ERROR_NOT_STORED;
    }
    const uint32_t at = 2 * flash->sector_bytes + upload->place.slot * maps->slot_bytes + offset;
    if (!(upload->erased & sector)) {
        // Even if it reads as erased: power may have failed during an erase, and then that may not last.
        if (!flash->erase(flash->context, at - at % flash->sector_bytes)) {
            return BT_ERROR_NOT_STORED;
        }
        upload->erased |= sector;
    }
    memset(page, 0xFF, sizeof page); // programming 0xFF changes nothing
    memcpy(page + at % BT_FLASH_PAGE_BYTES, data, bytes);
    if (!flash->program(flash->context, at - at % BT_FLASH_PAGE_BYTES, page)
        || memcmp(stored, data, bytes) != 0) {
        return BT_ERROR_NOT_STORED;
    }
    upload->written[part / 8] |= (uint8_t)(1u << part % 8);
    return BT_ERROR_OK;
}

bool bt_upload_whole(const bt_upload *upload)
{
    const size_t parts = (upload->place.bytes + BT_MAP_PART_BYTES - 1) / BT_MAP_PART_BYTES;
    for (size_t part = 0; part < parts; part++) {
        if (!is_written(upload, part)) {
            return false;
        }
    }
    return true;
}
