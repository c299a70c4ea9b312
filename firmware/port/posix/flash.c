#define _DEFAULT_SOURCE
#include "flash.h"

#include "only_board.h"
#include "os.h"

#include "map/store.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int file = -1;
static uint8_t flash[BT_KEPT_BYTES]; // what the file has

// Write a part of it to the file.
static bool keep(size_t offset, size_t bytes)
{
    return lseek(file, (off_t)offset, SEEK_SET) == (off_t)offset
           && (size_t)write(file, flash + offset, (unsigned)bytes) == bytes;
}

static bool load(size_t bytes)
{
    return lseek(file, 0, SEEK_SET) == 0 && (size_t)read(file, flash, (unsigned)bytes) == bytes;
}

const char *flash_open(const char *path)
{
    struct stat s;
    memset(flash, 0xFF, sizeof flash);
    FILE *nameless = path == NULL ? tmpfile() : NULL;
    file = path != NULL       ? open(path, O_RDWR | O_CREAT | O_BINARY, 0666)
           : nameless != NULL ? fileno(nameless)
                              : -1;
    if (file < 0 || fstat(file, &s) != 0) {
        return strerror(errno);
    }
    // One of settings alone is of a release that had no maps.
    if (s.st_size != 0 && s.st_size != BT_STORAGE_BYTES && s.st_size != BT_KEPT_BYTES) {
        return "not a flash file: its size is not that of the simulated board's flash; choose another file";
    }
    if (!load((size_t)s.st_size)) {
        return strerror(errno);
    }
    return keep((size_t)s.st_size, BT_KEPT_BYTES - (size_t)s.st_size)
               ? NULL
               : "cannot be extended to its full size; is the disk full?";
}

const char *flash_resume(int number)
{
    file = os_inherited(number);
    return load(sizeof flash) ? NULL : strerror(errno);
}

int flash_inherit(void)
{
    return os_inherit(file);
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    memset(flash + sector_offset, 0xFF, BT_FLASH_SECTOR_BYTES);
    return keep(sector_offset, BT_FLASH_SECTOR_BYTES);
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    for (int k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        flash[page_offset + (uint32_t)k] &= page[k];
    }
    return keep(page_offset, BT_FLASH_PAGE_BYTES);
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, flash + offset, bytes);
}

const uint8_t *flash_maps(void)
{
    return flash + BT_STORAGE_BYTES;
}
