// The flash chip: settings in the last two sectors, wrench maps before them, and the unique number. It is not
// readable as memory while it erases, programs or answers commands. The program runs in SRAM all the same;
// interrupts are off so that a handler that might one day read flash does not fault.
#include "only_board.h"

#include "map/store.h"

#include "system.h"

#include "chip_flash.h"

#include <string.h>

// The chip's linker script reserves both.
#define STORAGE_OFFSET (FLASH_BYTES - BT_STORAGE_BYTES) // same place as before there were maps
#define MAPS_OFFSET    (STORAGE_OFFSET - BT_MAPS_BYTES)

#define SECTOR_ERASE 0x20 // the flash's command for BT_FLASH_SECTOR_BYTES

#define JEDEC_ID_COMMAND 0x9F // then three bytes, the manufacturer's first
#define JEDEC_ISSI       0x9D

// Read unique ID: the command, four dummy bytes, then the eight of the number.
#define UNIQUE_ID_COMMAND 0x4B
#define UNIQUE_ID_AT      5

typedef void (*rom_erase)(uint32_t offset, uint32_t bytes, uint32_t block_bytes, uint32_t block_command);
typedef void (*rom_program)(uint32_t offset, const uint8_t *data, uint32_t bytes);

static struct {
    rom_action connect;  // "IF": the pins to the flash
    rom_action exit_xip; // "EX": the flash out of any read mode, into commands
    rom_action flush;    // "FC": clear the cache
    rom_erase erase;     // "RE"
    rom_program program; // "RP"
} rom;

static bool usable;
uint8_t flash_jedec_id[3];
uint32_t flash_erase_us;

void flash_start(void)
{
    rom.connect = (rom_action)rom_function('I', 'F');
    rom.exit_xip = (rom_action)rom_function('E', 'X');
    rom.flush = (rom_action)rom_function('F', 'C');
    rom.erase = (rom_erase)rom_function('R', 'E');
    rom.program = (rom_program)rom_function('R', 'P');
    usable = chip_flash_start() && rom.connect != NULL && rom.exit_xip != NULL && rom.flush != NULL
             && rom.erase != NULL && rom.program != NULL;
}

static uint32_t exit_xip(void)
{
    uint32_t primask = interrupts_disable();
    rom.connect();
    rom.exit_xip();
    return primask;
}

static void back_to_xip(uint32_t primask)
{
    rom.flush();
    chip_flash_readable();
    (void)USB_SOF_RD; // clears: a frame that began meanwhile would count as new (data.c, may_arm)
    usb_starts = usb_starts + 1;
    interrupts_restore(primask);
}

// Offset on the chip for an offset of port.h, which counts from the settings' first byte.
static uint32_t on_chip(uint32_t offset)
{
    return offset < BT_STORAGE_BYTES ? STORAGE_OFFSET + offset : MAPS_OFFSET + (offset - BT_STORAGE_BYTES);
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    if (!usable || sector_offset >= BT_KEPT_BYTES) {
        return false;
    }
    watchdog_feed(); // before 0.4 s without the main loop
    uint32_t since_us = port_now_us(port);
    uint32_t primask = exit_xip();
    rom.erase(on_chip(sector_offset), BT_FLASH_SECTOR_BYTES, BT_FLASH_SECTOR_BYTES, SECTOR_ERASE);
    back_to_xip(primask);
    uint32_t elapsed_us = port_now_us(port) - since_us;
    flash_erase_us = elapsed_us > flash_erase_us ? elapsed_us : flash_erase_us;
    return true;
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    if (!usable || page_offset >= BT_KEPT_BYTES) {
        return false;
    }
    uint32_t primask = exit_xip();
    rom.program(on_chip(page_offset), page, BT_FLASH_PAGE_BYTES);
    back_to_xip(primask);
    return true;
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, (const uint8_t *)(uintptr_t)(XIP_BASE + on_chip(offset)), bytes);
}

const uint8_t *flash_maps(void)
{
    return (const uint8_t *)(uintptr_t)(XIP_BASE + MAPS_OFFSET);
}

// Sends a command and reads as many bytes as it sends.
static bool exchange(uint8_t command, volatile uint8_t *answer, uint32_t bytes)
{
    uint32_t primask = exit_xip();
    bool whole = chip_flash_exchange(command, answer, bytes);
    back_to_xip(primask);
    return whole;
}

bool flash_identify(uint8_t id[FLASH_ID_BYTES])
{
    uint8_t answer[UNIQUE_ID_AT + 2 * FLASH_ID_BYTES];
    uint8_t all = 0xFF, any = 0;
    if (usable && exchange(JEDEC_ID_COMMAND, answer, 1 + sizeof flash_jedec_id)) {
        memcpy(flash_jedec_id, answer + 1, sizeof flash_jedec_id);
    }
    // ISSI's number has 16 bytes; a neighbour may have the same first eight (pico-sdk #1641).
    const uint32_t at = UNIQUE_ID_AT + (flash_jedec_id[0] == JEDEC_ISSI ? FLASH_ID_BYTES : 0);
    if (!usable || !exchange(UNIQUE_ID_COMMAND, answer, at + FLASH_ID_BYTES)) {
        return false;
    }
    for (int k = 0; k < FLASH_ID_BYTES; k++) {
        id[k] = answer[at + (uint32_t)k];
        all &= id[k];
        any |= id[k];
    }
    return all != 0xFF && any != 0; // else nothing drives the line
}
