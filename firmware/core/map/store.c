#include "map/store.h"

#include "wire/crc32.h"
#include "wire/little_endian.h"

_Static_assert(BT_MAP_SLOT_BYTES % BT_FLASH_SECTOR_BYTES == 0, "a slot is erased without touching another");
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

void bt_finger_map_reset(bt_finger_map *its)
{
    *its = (bt_finger_map){.stored_slot = BT_MAP_SLOTS};
}

const uint8_t *bt_map_bytes(const bt_map_flash *flash, const bt_map_place *place)
{
    return flash->bytes + (size_t)place->slot * BT_MAP_SLOT_BYTES;
}

void bt_finger_map_load(bt_finger_map *its, const bt_map_flash *flash, uint16_t version,
                        const uint8_t *record, size_t bytes)
{
    bt_finger_map_reset(its);
    if (bytes < 4 || bt_get_u32(record) >= BT_MAP_SLOTS) {
        return;
    }
    its->stored_slot = (uint8_t)bt_get_u32(record); // whatever else is new in a later version
    if (version != BT_MAP_RECORD_VERSION || bytes != BT_MAP_RECORD_BYTES) {
        return;
    }
    uint32_t size = bt_get_u32(record + 4), crc32 = bt_get_u32(record + 8);
    if (size == 0 || size > BT_MAP_MAX_BYTES) {
        return;
    }
    bt_map_place place = {.slot = its->stored_slot, .bytes = (uint16_t)size, .crc32 = crc32};
    const uint8_t *blob = bt_map_bytes(flash, &place);
    if (bt_crc32(blob, size) == crc32 && bt_map_open(&its->map, blob, size) == BT_ERROR_OK) {
        its->place = place;
    }
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

uint8_t bt_map_free_slot(const bt_finger_map maps[BT_MAX_FINGERS], uint8_t last)
{
    uint8_t slot = last;
    do { // ends: five fingers have two slots each at most, and there is one more
        slot = (uint8_t)((slot + 1) % BT_MAP_SLOTS);
    } while (!is_free(maps, slot));
    return slot;
}
