// Records that survive a loss of power, in two sectors of NOR flash.
//
// One sector is in use. It begins with a page that says so and counts its generation; each page after it
// holds one record: id, version, size, CRC-32, data. A newer record of an id stands for the older ones. When
// the sector is full, the latest record of every id is copied to the other one, which is in use from the
// moment its first page is whole; the old sector stays as it is until then. So power may fail at any
// byte of any write: afterwards the old record or the new one is found, whole.
#ifndef BIOTAC_STORAGE_H
#define BIOTAC_STORAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BT_FLASH_SECTOR_BYTES   4096 // what is erased at once, to 0xFF
#define BT_FLASH_PAGE_BYTES     256  // what is programmed at once; clears bits, sets none
#define BT_STORAGE_BYTES        (2 * BT_FLASH_SECTOR_BYTES)
#define BT_STORAGE_HEADER_BYTES 16
#define BT_STORAGE_MAX_BYTES    (BT_FLASH_PAGE_BYTES - BT_STORAGE_HEADER_BYTES) // of one record's data

// What the ids stand for; they are 1..BT_STORAGE_IDS and never reused.
#define BT_STORAGE_IDS 12
enum bt_record {
    BT_RECORD_SETTINGS = 1,
    BT_RECORD_CALIBRATION = 2, // of finger 0; the next four are of fingers 1 to 4
    BT_RECORD_MAP = 8,         // likewise
};

// Offsets count bytes from the beginning of the two sectors. erase and program return false when the flash
// did not do it; what they left behind is then unknown.
typedef struct {
    bool (*erase)(uint32_t sector_offset);
    bool (*program)(uint32_t page_offset, const uint8_t page[BT_FLASH_PAGE_BYTES]);
    void (*read)(uint32_t offset, uint8_t *data, size_t bytes);
} bt_flash;

// The latest record of this id: its data into data, as much of it as max_bytes holds, its version into
// *version. Returns the record's whole size, or -1 when there is none.
int bt_storage_read(const bt_flash *flash, uint16_t id, uint16_t *version, uint8_t *data, size_t max_bytes);

// False when the id or the size is out of range or the flash did not keep it; what was stored before then
// still stands. Writes nothing when the same record is stored already: flash wears.
bool bt_storage_write(const bt_flash *flash, uint16_t id, uint16_t version, const uint8_t *data,
                      size_t bytes);

// Something is written that is no whole record: power failed in the middle of a write, or the flash has lost
// bits. What is read may then be an older record, or none.
bool bt_storage_damaged(const bt_flash *flash);

// One record as its page holds it, for who keeps records elsewhere: behind header and data all is 0xFF.
void bt_storage_make_page(uint8_t page[BT_FLASH_PAGE_BYTES], uint16_t id, uint16_t version,
                          const uint8_t *data, size_t bytes);

// It holds a whole record of this id.
bool bt_storage_page_is(const uint8_t page[BT_FLASH_PAGE_BYTES], uint16_t id);

#endif
