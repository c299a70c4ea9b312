#define _DEFAULT_SOURCE
#include "flash.h"

#include "only_board.h"

#include "map/store.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

static int file = -1;
static uint8_t *flash;

const char *flash_open(const char *path)
{
    static uint8_t erased[BT_KEPT_BYTES];
    struct stat s;
    memset(erased, 0xFF, sizeof erased);
    FILE *nameless = path == NULL ? tmpfile() : NULL;
    int fd = path != NULL ? open(path, O_RDWR | O_CREAT, 0666) : nameless != NULL ? fileno(nameless) : -1;
    if (fd < 0 || fstat(fd, &s) != 0) {
        return strerror(errno);
    }
    // One of settings alone is of a release that had no maps.
    if (s.st_size != 0 && s.st_size != BT_STORAGE_BYTES && s.st_size != BT_KEPT_BYTES) {
        return "not a flash file: its size is not that of the simulated board's flash; choose another file";
    }
    size_t missing = BT_KEPT_BYTES - (size_t)s.st_size;
    if (pwrite(fd, erased, missing, s.st_size) != (ssize_t)missing) {
        return "cannot be extended to its full size; is the disk full?";
    }
    return flash_resume(fd);
}

const char *flash_resume(int fd)
{
    void *bytes = mmap(NULL, BT_KEPT_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (bytes == MAP_FAILED) {
        return strerror(errno);
    }
    flash = bytes;
    file = fd;
    return NULL;
}

int flash_fd(void)
{
    return file;
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    memset(flash + sector_offset, 0xFF, BT_FLASH_SECTOR_BYTES);
    return true;
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    for (int k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        flash[page_offset + (uint32_t)k] &= page[k];
    }
    return true;
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, flash + offset, bytes);
}

const uint8_t *flash_maps(void)
{
    return flash + BT_STORAGE_BYTES;
}
