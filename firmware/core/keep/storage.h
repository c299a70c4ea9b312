// Records that survive a loss of power, in two sectors of NOR flash.
//
// One sector is in use. The first page marks it and holds the sector's generation; each later page holds one
// record: id, version, size, CRC-32, data. A newer record replaces the older ones of one id. A full sector's
// latest records, one of every id, are copied to the other sector, which replaces the old one once the new
// first page is whole; until then the old sector stays as it is. So power may fail at any byte of any write:
// afterwards either the old record or the new one is found whole.
#ifndef BIOTAC_STORAGE_H
#define BIOTAC_STORAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BT_FLASH_PAGE_BYTES     256 // unit of programming, which only clears bits; once between two erases
#define BT_STORAGE_HEADER_BYTES 16
#define BT_STORAGE_MAX_BYTES    (BT_FLASH_PAGE_BYTES - BT_STORAGE_HEADER_BYTES) // data of one record

// The sector of most flash chips.
#define BT_FLASH_SECTOR_BYTES 4096
#define BT_STORAGE_BYTES      (2 * BT_FLASH_SECTOR_BYTES)

// Record ids are 1..BT_STORAGE_IDS and never reused.
#define BT_STORAGE_IDS 12
enum bt_record {
    BT_RECORD_SETTINGS = 1,
    BT_RECORD_CALIBRATION = 2, // of finger 0; fingers 1 to 4 have the next four
    BT_RECORD_MAP = 8,         // likewise
};

// Offsets are bytes from the start of the two sectors, and go on behind them (map/store.h). erase and program
// return false if the flash failed; the contents are then unknown.
typedef struct {
    uint32_t sector_bytes; // unit of erasing, to 0xFF: a multiple of a page, at least 16
    void *context;         // first argument of all three
    bool (*erase)(void *context, uint32_t sector_offset);
    bool (*program)(void *context, uint32_t page_offset, const uint8_t page[BT_FLASH_PAGE_BYTES]);
    void (*read)(void *context, uint32_t offset, uint8_t *data, size_t bytes);
} bt_flash;

// Read the latest record of this id: the version, and as much data as fits max_bytes. Returns the size of all
// the data, or -1 when there is no record.
int bt_storage_read(const bt_flash *flash, uint16_t id, uint16_t *version, uint8_t *data, size_t max_bytes);

// Returns false when the id or size is out of range, or when the flash failed; the old record is then still
// valid. Skips a write of the record already stored: flash wears.
bool bt_storage_write(const bt_flash *flash, uint16_t id, uint16_t version, const uint8_t *data,
                      size_t bytes);

// True when a stored page is not a whole record: power failed during a write, or the flash lost bits. Reading
// may then give an older record, or none.
bool bt_storage_damaged(const bt_flash *flash);

// Make the page of one record, for records kept elsewhere. The rest of the page is 0xFF.
void bt_storage_make_page(uint8_t page[BT_FLASH_PAGE_BYTES], uint16_t id, uint16_t version,
                          const uint8_t *data, size_t bytes);

// True when the page holds a whole record of this id.
bool bt_storage_page_is(const uint8_t page[BT_FLASH_PAGE_BYTES], uint16_t id);

#endif
