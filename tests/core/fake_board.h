// A board's flash in memory, as a session has it: the settings' two sectors, then the slots for maps.
#ifndef BIOTAC_TEST_FAKE_BOARD_H
#define BIOTAC_TEST_FAKE_BOARD_H

#include "talk/host_link.h"
#include "talk/rounds.h"
#include "talk/saved.h"
#include "talk/sensors.h"
#include "wire/little_endian.h"

#include <stdlib.h>
#include <string.h>

static _Alignas(4) uint8_t kept[BT_KEPT_BYTES];
#define SLOTS (kept + BT_STORAGE_BYTES)
static int erases, programs;     // of slots
static uint32_t records_written; // bit mask of record ids
static uint16_t refused_record;  // which the flash does not take; 0: none
static bool worn;                // slots take nothing

static inline bool kept_erase(void *context, uint32_t offset)
{
    (void)context;
    if (offset % BT_FLASH_SECTOR_BYTES != 0 || offset >= BT_KEPT_BYTES) {
        abort();
    }
    memset(kept + offset, 0xFF, BT_FLASH_SECTOR_BYTES);
    erases += offset >= BT_STORAGE_BYTES;
    return true;
}

static inline bool kept_program(void *context, uint32_t offset, const uint8_t *page)
{
    (void)context;
    const bool is_slot = offset >= BT_STORAGE_BYTES;
    if (offset % BT_FLASH_PAGE_BYTES != 0 || offset >= BT_KEPT_BYTES) {
        abort();
    }
    if (!is_slot) {
        const uint16_t id = bt_get_u16(page + 4);
        if (id == refused_record) {
            return false;
        }
        records_written |= id <= BT_STORAGE_IDS ? 1u << id : 0;
    }
    programs += is_slot;
    for (int k = 0; k < BT_FLASH_PAGE_BYTES && !(is_slot && worn); k++) {
        kept[offset + (uint32_t)k] &= page[k];
    }
    return true;
}

static inline void kept_read(void *context, uint32_t offset, uint8_t *data, size_t bytes)
{
    (void)context;
    memcpy(data, kept + offset, bytes);
}

static const bt_flash flash = {
    .sector_bytes = BT_FLASH_SECTOR_BYTES, .erase = kept_erase, .program = kept_program, .read = kept_read};

static _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
static const bt_map_flash map_flash = {.flash = &flash,
                                       .slot_bytes = BT_MAP_SLOT_BYTES,
                                       .max_bytes = BT_MAP_MAX_BYTES,
                                       .slots = BT_MAP_SLOTS,
                                       .bytes = SLOTS,
                                       .ram = map_ram[0]};

static const bt_board_actions keeps = {.flash = &flash, .maps = &map_flash};

#endif
