// Where wrench maps lie: in flash, in slots of whole sectors. A record in storage.h says which slot holds a
// finger's map; what is in force is a copy in RAM, because a board's flash may take ten times as long to
// read. There is a slot for what each finger has stored, one for what it has in force since, and one for what
// is being uploaded: so nothing that is stored or in force is ever written to, and power may fail at any
// byte.
#ifndef BIOTAC_MAP_STORE_H
#define BIOTAC_MAP_STORE_H

#include "keep/storage.h"
#include "map/map.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#define BT_MAP_SLOT_BYTES BT_MAP_MAX_BYTES // a multiple of the sector
#define BT_MAP_SLOTS      (2 * BT_MAX_FINGERS + 1)
#define BT_MAPS_BYTES     (BT_MAP_SLOTS * BT_MAP_SLOT_BYTES)
#define BT_KEPT_BYTES     (BT_STORAGE_BYTES + BT_MAPS_BYTES) // all that a board keeps: settings, then maps

// Offsets count bytes from the first slot. erase and program as in bt_flash; bytes is all slots as memory,
// which changes with them. ram: room for what each finger has in force, aligned to 4 bytes.
typedef struct {
    bool (*erase)(uint32_t sector_offset);
    bool (*program)(uint32_t page_offset, const uint8_t page[BT_FLASH_PAGE_BYTES]);
    const uint8_t *bytes;
    uint8_t (*ram)[BT_MAP_MAX_BYTES];
} bt_map_flash;

// A map in a slot; none where bytes is 0.
typedef struct {
    uint8_t slot;
    uint16_t bytes;
    uint32_t crc32;
} bt_map_place;

// What a finger has.
typedef struct {
    bt_map_place place;
    bt_map map;
    bool unsaved;        // set or cleared since it was stored
    uint8_t stored_slot; // that its record names; BT_MAP_SLOTS: none
} bt_finger_map;

// As a stored record, little-endian: u32 slot, u32 bytes, u32 CRC-32. A cleared one is a record of no bytes.
// Every version begins with the slot, so that no firmware writes to another one's.
#define BT_MAP_RECORD_VERSION 1
#define BT_MAP_RECORD_BYTES   12

// Returns the record's size.
size_t bt_map_place_pack(const bt_map_place *place, uint8_t record[BT_MAP_RECORD_BYTES]);

// No map, nothing stored.
void bt_finger_map_reset(bt_finger_map *its);

// From a record. A map that is damaged or that this firmware cannot compute is none, but stays stored: false.
bool bt_finger_map_load(bt_finger_map *its, const bt_map_flash *flash, uint8_t finger, uint16_t version,
                        const uint8_t *record, size_t bytes);

// Copy a map to the finger's RAM and judge it there; OK: it is the finger's. Otherwise the one that the
// finger had is in RAM again. serial: of the sensor that it must be made for. Returns an enum bt_error:
// NOT_WHOLE when its bytes have another CRC-32, OUT_OF_RANGE when it is no map that this firmware can
// compute, OTHER_SENSOR.
uint8_t bt_finger_map_use(bt_finger_map *its, const bt_map_flash *flash, uint8_t finger,
                          const bt_map_place *place, const uint8_t *serial);

// The map as bytes, in flash.
const uint8_t *bt_map_bytes(const bt_map_flash *flash, const bt_map_place *place);

// A slot that no finger has anything in; the first behind `last`, so that they wear alike and one that takes
// nothing is passed by.
uint8_t bt_map_free_slot(const bt_finger_map maps[BT_MAX_FINGERS], uint8_t last);

#endif
