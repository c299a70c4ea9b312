#include "map/store.h"

#include "keep/calibration.h"
#include "wire/crc32.h"
#include "wire/little_endian.h"

#include <string.h>

_Static_assert(BT_MAP_MAX_BYTES <= UINT16_MAX, "the size of a map fits its field");

size_t bt_map_place_pack(const bt_map_place *place, uint8_t record[BT_MAP_RECORD_BYTES])
{
    if (place->bytes == 0) {
        return 0;
    }
    bt_put_u32(record, place->slot);
    bt_put_u32(record + 4, place->bytes);
    bt_put_u32(record + 8, place->crc32);
    return BT_MAP_RECORD_BYTES;
}

void bt_finger_map_reset(bt_finger_map *kept)
{
    *kept = (bt_finger_map){.stored_slot = BT_MAP_SLOTS};
}

const uint8_t *bt_map_bytes(const bt_map_flash *flash, const bt_map_place *place)
{
    return flash->bytes + (size_t)place->slot * flash->slot_bytes;
}

// Returns OK, NOT_WHOLE or OUT_OF_RANGE, see bt_finger_map_use.
static uint8_t copy_to_ram(bt_map *map, const bt_map_flash *flash, uint8_t finger, const bt_map_place *place)
{
    uint8_t *ram = flash->ram + (size_t)finger * flash->max_bytes;
    memcpy(ram, bt_map_bytes(flash, place), place->bytes);
    if (bt_crc32(ram, place->bytes) != place->crc32) {
        return BT_ERROR_NOT_WHOLE;
    }
    return bt_map_open(map, ram, place->bytes) == BT_ERROR_OK ? BT_ERROR_OK : BT_ERROR_OUT_OF_RANGE;
}

uint8_t bt_finger_map_use(bt_finger_map *kept, const bt_map_flash *flash, uint8_t finger,
                          const bt_map_place *place, const uint8_t *serial)
{
    bt_map map;
    uint8_t error = copy_to_ram(&map, flash, finger, place);
    if (error == BT_ERROR_OK && !bt_serial_fits(map.serial, serial)) {
        error = BT_ERROR_OTHER_SENSOR;
    }
    if (error == BT_ERROR_OK) {
        kept->map = map;
        kept->place = *place;
    } else if (kept->place.bytes != 0
               && copy_to_ram(&kept->map, flash, finger, &kept->place) != BT_ERROR_OK) {
        kept->place.bytes = 0; // the flash has changed: rather no map than half of each
        bt_map_close(&kept->map);
    }
    return error;
}

bool bt_finger_map_load(bt_finger_map *kept, const bt_map_flash *flash, uint8_t finger, uint16_t version,
                        const uint8_t *record, size_t bytes)
{
    bt_finger_map_reset(kept);
    if (bytes < 4 || bt_get_u32(record) >= flash->slots) {
        return false;
    }
    kept->stored_slot = (uint8_t)bt_get_u32(record); // in every version
    if (version != BT_MAP_RECORD_VERSION || bytes != BT_MAP_RECORD_BYTES) {
        return false;
    }
    uint32_t size = bt_get_u32(record + 4), crc32 = bt_get_u32(record + 8);
    if (size == 0 || size > flash->max_bytes) {
        return size == 0;
    }
    bt_map_place place = {.slot = kept->stored_slot, .bytes = (uint16_t)size, .crc32 = crc32};
    if (copy_to_ram(&kept->map, flash, finger, &place) != BT_ERROR_OK) {
        return false;
    }
    kept->place = place;
    return true;
}

static bool is_free(const bt_finger_map maps[BT_MAX_FINGERS], uint8_t slot)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (maps[f].stored_slot == slot || (maps[f].place.bytes != 0 && maps[f].place.slot == slot)) {
            return false;
        }
    }
    return true;
}

uint8_t bt_map_free_slot(const bt_map_flash *flash, const bt_finger_map maps[BT_MAX_FINGERS], uint8_t last)
{
    uint8_t slot = last;
    do { // ends: a finger uses at most two slots and there is one more
        slot = (uint8_t)((slot + 1) % flash->slots);
    } while (!is_free(maps, slot));
    return slot;
}
