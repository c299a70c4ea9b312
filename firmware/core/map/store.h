// Wrench maps in flash, in slots of whole sectors. A record (storage.h) names the slot of a finger's map. The
// map in force is a copy in RAM, because flash may be ten times slower to read. Each finger has a slot for
// the stored map and one for the map put in force since; one more slot is for an upload under way. So a
// stored map, or one in force, is never overwritten, and power may fail at any byte.
#ifndef BIOTAC_MAP_STORE_H
#define BIOTAC_MAP_STORE_H

#include "keep/storage.h"
#include "map/map.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#define BT_MAP_SLOTS_OF(fingers) (2 * (fingers) + 1)

// For a board with five fingers, the largest maps and sectors of 4 KiB; the settings come first.
#define BT_MAP_SLOT_BYTES BT_MAP_MAX_BYTES
#define BT_MAP_SLOTS      BT_MAP_SLOTS_OF(BT_MAX_FINGERS)
#define BT_MAPS_BYTES     (BT_MAP_SLOTS * BT_MAP_SLOT_BYTES)
#define BT_KEPT_BYTES     (BT_STORAGE_BYTES + BT_MAPS_BYTES)

// The slots follow the settings' two sectors. bytes: all slots as memory, which changes with the flash. ram:
// max_bytes, a multiple of 4, for each finger's map in force, aligned to 4.
typedef struct {
    const bt_flash *flash;
    uint32_t slot_bytes; // whole sectors: erasing a slot touches no other
    uint16_t max_bytes;  // of a map: at most slot_bytes and BT_MAP_MAX_BYTES
    uint8_t slots;
    const uint8_t *bytes;
    uint8_t *ram;
} bt_map_flash;

// A map in a slot; no map if bytes is 0.
typedef struct {
    uint8_t slot;
    uint16_t bytes;
    uint32_t crc32;
} bt_map_place;

typedef struct {
    bt_map_place place;
    bt_map map;
    bool unsaved;        // set or cleared since it was stored
    uint8_t stored_slot; // slot in the stored record; BT_MAP_SLOTS: none
} bt_finger_map;

// The stored record, little-endian: u32 slot, u32 bytes, u32 CRC-32. A cleared map is a record of no bytes.
// Every version begins with the slot, so that no firmware overwrites the map of another version.
#define BT_MAP_RECORD_VERSION 1
#define BT_MAP_RECORD_BYTES   12

// Returns the record's size.
size_t bt_map_place_pack(const bt_map_place *place, uint8_t record[BT_MAP_RECORD_BYTES]);

// Reset to no map and nothing stored.
void bt_finger_map_reset(bt_finger_map *kept);

// Load a map from its record. Returns false, with no map, if it is damaged or this firmware cannot compute
// it; it stays stored.
bool bt_finger_map_load(bt_finger_map *kept, const bt_map_flash *flash, uint8_t finger, uint16_t version,
                        const uint8_t *record, size_t bytes);

// Copy a map to the finger's RAM, check it there and put it in force. If that fails, the finger's previous
// map is in RAM again. serial: of the finger's sensor, which the map must fit. Returns an enum bt_error: OK,
// NOT_WHOLE (wrong CRC-32), OUT_OF_RANGE (no map that this firmware can compute) or OTHER_SENSOR.
uint8_t bt_finger_map_use(bt_finger_map *kept, const bt_map_flash *flash, uint8_t finger,
                          const bt_map_place *place, const uint8_t *serial);

// The map's bytes in flash.
const uint8_t *bt_map_bytes(const bt_map_flash *flash, const bt_map_place *place);

// The first slot after `last` that no finger uses: all slots wear alike, and a slot that failed is passed
// over.
uint8_t bt_map_free_slot(const bt_map_flash *flash, const bt_finger_map maps[BT_MAX_FINGERS], uint8_t last);

#endif
