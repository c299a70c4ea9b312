// NOR flash on a supply that fails: after so many bytes, before so many erases and programs, or inside of
// one.
#ifndef BIOTAC_TEST_FAILING_FLASH_H
#define BIOTAC_TEST_FAILING_FLASH_H

#include "support.h"

#include "keep/storage.h"

typedef struct {
    uint8_t *bytes;
    size_t sector_bytes;
    long bytes_left;      // that are still erased or programmed before power fails; -1: it holds
    long dud;             // a page of worn cells: says that it is programmed, and is not; -1: none
    long operations_left; // erases and programs that are still done before power fails; -1: it holds
    bool inside;          // power fails within the next byte: some of the bits to change are done
    bool backwards;       // of a sector or page, the last byte first
    bool ragged;          // the byte at which power fails has only some bits done
    uint64_t seed;
    int erases;
    jmp_buf power_fails; // where to go then
} failing_flash;

// Erased, on a supply that holds. `bytes` are the caller's.
static inline void flash_new(failing_flash *flash, uint8_t *bytes, size_t size)
{
    memset(bytes, 0xFF, size);
    *flash = (failing_flash){.bytes = bytes,
                             .sector_bytes = BT_FLASH_SECTOR_BYTES,
                             .bytes_left = -1,
                             .dud = -1,
                             .operations_left = -1,
                             .seed = 1};
}

// Each byte takes the bits of `page`, or is erased when `page` is NULL.
static inline void flash_change(failing_flash *flash, size_t at, size_t size, const uint8_t *page)
{
    bool fails = flash->operations_left == 0;
    if (fails && !flash->inside) {
        longjmp(flash->power_fails, 1);
    }
    const long left = flash->bytes_left;
    const size_t done = fails ? 0 : left < 0 || left > (long)size ? size : (size_t)left;
    const size_t first = flash->backwards ? size - done : 0;
    for (size_t k = first; page != NULL && k < first + done; k++) {
        flash->bytes[at + k] &= page[k];
    }
    if (page == NULL) {
        memset(&flash->bytes[at + first], 0xFF, done);
    }
    flash->bytes_left -= left > 0 ? (long)done : 0;
    for (size_t n = done; n < size; n++) { // at which power fails
        size_t k = flash->backwards ? size - 1 - n : n;
        uint8_t *byte = &flash->bytes[at + k];
        uint8_t changing = page == NULL ? (uint8_t)~*byte : (uint8_t)(*byte & ~page[k]);
        *byte ^= fails || flash->ragged ? (uint8_t)(changing & random_u64(&flash->seed)) : 0;
        if (!fails) {
            longjmp(flash->power_fails, 1);
        }
    }
    if (fails) {
        longjmp(flash->power_fails, 1);
    }
    flash->operations_left -= flash->operations_left > 0;
}

static inline void flash_erase(failing_flash *flash, size_t at)
{
    flash->erases++;
    flash_change(flash, at, flash->sector_bytes, NULL);
}

// Programming never sets a bit.
static inline void flash_program(failing_flash *flash, size_t at, const uint8_t *page)
{
    if ((long)at != flash->dud) {
        flash_change(flash, at, BT_FLASH_PAGE_BYTES, page);
    }
}

#endif
