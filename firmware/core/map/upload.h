// Upload of a wrench map into a slot of flash, part by part. Nothing uses the slot until the map is whole.
#ifndef BIOTAC_UPLOAD_H
#define BIOTAC_UPLOAD_H

#include "map/store.h"

#define BT_MAP_PART_BYTES sizeof(((bt_msg_write_map *)NULL)->data)
#define BT_MAP_PARTS      (BT_MAP_MAX_BYTES / BT_MAP_PART_BYTES)

typedef struct {
    bool open;
    uint8_t finger;
    bt_map_place place;                // the slot, and the size and CRC announced
    uint32_t erased;                   // bit mask of the slot's sectors
    uint8_t written[BT_MAP_PARTS / 8]; // bit mask of the parts
} bt_upload;

// Write one part; offset is a multiple of BT_MAP_PART_BYTES. Bytes beyond the map's end are not written.
// Erases at most one sector, before the sector's first part. Returns an enum bt_error: OK, also for a part
// already there; OUT_OF_RANGE; or NOT_STORED when the flash failed or holds another part in its place.
uint8_t bt_upload_write(bt_upload *upload, const bt_map_flash *maps, uint16_t offset,
                        const uint8_t data[BT_MAP_PART_BYTES]);

// True once every part is written.
bool bt_upload_whole(const bt_upload *upload);

#endif
