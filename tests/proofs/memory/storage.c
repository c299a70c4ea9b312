// Reads and writes of records in a flash that holds anything and may fail at any time.
#include "keep/storage.h"

#include <__fc_builtin.h>

static bool erase(void *context, uint32_t offset)
{
    (void)context;
    //@ check offset <= BT_STORAGE_BYTES - BT_FLASH_SECTOR_BYTES;
    return Frama_C_interval(0, 1);
}

static bool program(void *context, uint32_t offset, const uint8_t *page)
{
    (void)context;
    //@ check offset <= BT_STORAGE_BYTES - BT_FLASH_PAGE_BYTES;
    //@ check \valid_read(page + (0 .. BT_FLASH_PAGE_BYTES - 1));
    return Frama_C_interval(0, 1);
}

static void read_flash(void *context, uint32_t offset, uint8_t *data, size_t bytes)
{
    (void)context;
    //@ check bytes <= BT_FLASH_PAGE_BYTES && offset <= BT_STORAGE_BYTES - BT_FLASH_PAGE_BYTES;
    Frama_C_make_unknown((char *)data, bytes);
}

static uint8_t data[BT_STORAGE_MAX_BYTES];

void main(void)
{
    const bt_flash flash = {BT_FLASH_SECTOR_BYTES, NULL, erase, program, read_flash};
    uint16_t version;
    size_t room = (size_t)Frama_C_interval(0, sizeof data);
    Frama_C_make_unknown((char *)data, sizeof data);
    (void)bt_storage_read(&flash, (uint16_t)Frama_C_interval(0, UINT16_MAX), &version, data, room);
    (void)bt_storage_write(&flash, (uint16_t)Frama_C_interval(0, UINT16_MAX),
                           (uint16_t)Frama_C_interval(0, UINT16_MAX), data, room);
    (void)bt_storage_damaged(&flash);
}
