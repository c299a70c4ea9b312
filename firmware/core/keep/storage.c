#include "keep/storage.h"

#include "wire/crc32.h"
#include "wire/little_endian.h"

#include <string.h>

#define LEAST_PAGES 16          // in a sector
#define MAGIC       0x52544F42u // "BOTR"
#define IN_USE_ID   0xFFFE      // id of a sector's first page; the data is the generation
#define CRC_AT      12          // the CRC covers the whole page, itself as erased
#define NO_SECTOR   (-1)

_Static_assert(BT_STORAGE_IDS < LEAST_PAGES - 1, "one record of each id and a new one must fit a sector");

// ---- one page -------------------------------------------------------------------------------------
// u32 magic, u16 id, u16 version, u32 size, u32 CRC-32, data; the rest stays erased.

static uint32_t page_crc(const uint8_t page[BT_FLASH_PAGE_BYTES])
{
    uint8_t copy[BT_FLASH_PAGE_BYTES];
    memcpy(copy, page, sizeof copy);
    memset(copy + CRC_AT, 0xFF, 4);
    return bt_crc32(copy, sizeof copy);
}

void bt_storage_make_page(uint8_t page[BT_FLASH_PAGE_BYTES], uint16_t id, uint16_t version,
                          const uint8_t *data, size_t bytes)
{
    memset(page, 0xFF, BT_FLASH_PAGE_BYTES);
    bt_put_u32(page, MAGIC);
    bt_put_u32(page + 4, id | (uint32_t)version << 16);
    bt_put_u32(page + 8, (uint32_t)bytes);
    memcpy(page + BT_STORAGE_HEADER_BYTES, data, bytes);
    bt_put_u32(page + CRC_AT, page_crc(page));
}

bool bt_storage_page_is(const uint8_t page[BT_FLASH_PAGE_BYTES], uint16_t id)
{
    return bt_get_u32(page) == MAGIC && bt_get_u16(page + 4) == id
           && bt_get_u32(page + 8) <= BT_STORAGE_MAX_BYTES && bt_get_u32(page + CRC_AT) == page_crc(page);
}

static bool page_blank(const uint8_t page[BT_FLASH_PAGE_BYTES])
{
    for (int k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        if (page[k] != 0xFF) {
            return false;
        }
    }
    return true;
}

static int pages(const bt_flash *flash)
{
    return (int)(flash->sector_bytes / BT_FLASH_PAGE_BYTES);
}

static uint32_t page_offset(const bt_flash *flash, int sector, int page)
{
    return (uint32_t)sector * flash->sector_bytes + (uint32_t)page * BT_FLASH_PAGE_BYTES;
}

static void read_page(const bt_flash *flash, int sector, int page, uint8_t out[BT_FLASH_PAGE_BYTES])
{
    flash->read(flash->context, page_offset(flash, sector, page), out, BT_FLASH_PAGE_BYTES);
}

// Programs a page and reads it back.
static bool keep_page(const bt_flash *flash, int sector, int page, const uint8_t data[BT_FLASH_PAGE_BYTES])
{
    uint8_t back[BT_FLASH_PAGE_BYTES];
    if (!flash->program(flash->context, page_offset(flash, sector, page), data)) {
        return false;
    }
    read_page(flash, sector, page, back);
    return memcmp(back, data, sizeof back) == 0;
}

// ---- sectors ---------------------------------------------------------------------------------------

// Returns the sector in use; of two, the one with the later generation.
static int sector_in_use(const bt_flash *flash, uint32_t *generation)
{
    int found = NO_SECTOR;
    uint8_t page[BT_FLASH_PAGE_BYTES];
    *generation = 0;
    for (int sector = 0; sector < 2; sector++) {
        read_page(flash, sector, 0, page);
        if (!bt_storage_page_is(page, IN_USE_ID)) {
            continue;
        }
        uint32_t here = bt_get_u32(page + BT_STORAGE_HEADER_BYTES);
        if (found == NO_SECTOR || (int32_t)(here - *generation) > 0) {
            found = sector;
            *generation = here;
        }
    }
    return found;
}

// Reads the latest whole record of this id into out. Returns the page number, 0 for none.
static int latest(const bt_flash *flash, int sector, uint16_t id, uint8_t out[BT_FLASH_PAGE_BYTES])
{
    for (int page = pages(flash) - 1; page > 0; page--) {
        read_page(flash, sector, page, out);
        if (bt_storage_page_is(out, id)) {
            return page;
        }
    }
    return 0;
}

// The page after the last written one; pages() when none is free.
static int first_free(const bt_flash *flash, int sector)
{
    uint8_t page[BT_FLASH_PAGE_BYTES];
    int at = pages(flash);
    while (at > 1) {
        read_page(flash, sector, at - 1, page);
        if (!page_blank(page)) {
            break;
        }
        at--;
    }
    return at;
}

// Write the record and the latest one of every other id to the other sector, then switch to that sector.
static bool move_on(const bt_flash *flash, int from, uint32_t generation, uint16_t id,
                    const uint8_t record[BT_FLASH_PAGE_BYTES])
{
    int to = from == 0 ? 1 : 0;
    int at = 1;
    uint8_t page[BT_FLASH_PAGE_BYTES];
    uint8_t data[4];
    if (!flash->erase(flash->context, page_offset(flash, to, 0)) || !keep_page(flash, to, at++, record)) {
        return false;
    }
    for (uint16_t other = 1; other <= BT_STORAGE_IDS; other++) {
        if (other != id && from != NO_SECTOR && latest(flash, from, other, page) != 0
            && !keep_page(flash, to, at++, page)) {
            return false;
        }
    }
    bt_put_u32(data, generation + 1);
    bt_storage_make_page(page, IN_USE_ID, 0, data, sizeof data);
    return keep_page(flash, to, 0, page);
}

// ---- interface ---------------------------------------------------------------------------------------

int bt_storage_read(const bt_flash *flash, uint16_t id, uint16_t *version, uint8_t *data, size_t max_bytes)
{
    uint8_t page[BT_FLASH_PAGE_BYTES];
    uint32_t generation;
    int sector = sector_in_use(flash, &generation);
    if (sector == NO_SECTOR || latest(flash, sector, id, page) == 0) {
        return -1;
    }
    size_t bytes = bt_get_u32(page + 8);
    *version = bt_get_u16(page + 6);
    memcpy(data, page + BT_STORAGE_HEADER_BYTES, bytes < max_bytes ? bytes : max_bytes);
    return (int)bytes;
}

static bool page_whole(const uint8_t page[BT_FLASH_PAGE_BYTES])
{
    return bt_storage_page_is(page, bt_get_u16(page + 4));
}

bool bt_storage_damaged(const bt_flash *flash)
{
    uint8_t page[BT_FLASH_PAGE_BYTES];
    uint32_t generation;
    int used = sector_in_use(flash, &generation);
    for (int sector = 0; sector < 2; sector++) {
        // In the unused sector only the first page counts: the rest is old, or a copy cut short.
        for (int at = 0; at < (sector == used ? pages(flash) : 1); at++) {
            read_page(flash, sector, at, page);
            if (!page_blank(page) && !page_whole(page)) {
                return true;
            }
        }
    }
    return false;
}

bool bt_storage_write(const bt_flash *flash, uint16_t id, uint16_t version, const uint8_t *data, size_t bytes)
{
    uint8_t record[BT_FLASH_PAGE_BYTES];
    uint8_t page[BT_FLASH_PAGE_BYTES];
    uint32_t generation;
    if (id == 0 || id > BT_STORAGE_IDS || bytes > BT_STORAGE_MAX_BYTES) {
        return false;
    }
    bt_storage_make_page(record, id, version, data, bytes);
    int sector = sector_in_use(flash, &generation);
    if (sector == NO_SECTOR) {
        return move_on(flash, NO_SECTOR, 0, id, record);
    }
    if (latest(flash, sector, id, page) != 0 && memcmp(page, record, sizeof page) == 0) {
        return true;
    }
    // A page that fails stays damaged; the next one may hold the record.
    for (int at = first_free(flash, sector); at < pages(flash); at++) {
        if (keep_page(flash, sector, at, record)) {
            return true;
        }
    }
    return move_on(flash, sector, generation, id, record);
}
