// The chip's flash: settings in sectors 1 and 2, of 16 KiB each; stm32f405.ld keeps the image off both. Every
// fetch from it stalls while it erases or programs, interrupts too (RM0090 3.6).
#include "only_board.h"

#include "stm32f405.h"

#include <string.h>

#define SECTOR_BYTES 16384u
#define FIRST_SECTOR 1u
#define SETTINGS_AT  (0x08000000u + FIRST_SECTOR * SECTOR_BYTES)
#define PAGE_BYTES   256u

uint32_t flash_erase_us;

static bool begin(uint32_t how)
{
    if (FLASH_CR & FLASH_CR_LOCK) { // the loader leaves it unlocked: a key is then a bus fault (qmk #13841)
        FLASH_KEYR = FLASH_KEY_1;
        FLASH_KEYR = FLASH_KEY_2;
    }
    if (!wait_for(&FLASH_SR, FLASH_SR_BSY, 0, WAIT_FLASH_TURNS)) {
        return false;
    }
    FLASH_SR = FLASH_SR_ERRORS; // writing 1 clears earlier ones
    FLASH_CR = FLASH_CR_BY_32 | how;
    return !(FLASH_CR & FLASH_CR_LOCK);
}

static bool done(void)
{
    return wait_for(&FLASH_SR, FLASH_SR_BSY, 0, WAIT_FLASH_TURNS) && !(FLASH_SR & FLASH_SR_ERRORS);
}

// The data cache of the flash is old by now.
static void end(void)
{
    FLASH_CR = FLASH_CR_LOCK;
    FLASH_ACR &= ~FLASH_ACR_DCEN;
    FLASH_ACR |= FLASH_ACR_DCRST;
    FLASH_ACR &= ~FLASH_ACR_DCRST;
    FLASH_ACR |= FLASH_ACR_DCEN;
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    const uint32_t start_us = clock_us();
    watchdog_feed(); // before 0.5 s without the main loop
    const uint32_t sector = FLASH_CR_SNB(FIRST_SECTOR + sector_offset / SECTOR_BYTES);
    bool erased = begin(FLASH_CR_SER | sector);
    if (erased) {
        FLASH_CR |= FLASH_CR_STRT;
        erased = done();
    }
    end();
    const uint32_t elapsed_us = clock_us() - start_us;
    flash_erase_us = elapsed_us > flash_erase_us ? elapsed_us : flash_erase_us;
    return erased;
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    volatile uint32_t *to = (volatile uint32_t *)(uintptr_t)(SETTINGS_AT + page_offset);
    bool programmed = begin(FLASH_CR_PG);
    for (uint32_t k = 0; k < PAGE_BYTES / 4 && programmed; k++) {
        uint32_t word;
        memcpy(&word, page + 4 * k, 4);
        to[k] = word;
        programmed = done();
    }
    end();
    return programmed;
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, (const uint8_t *)(uintptr_t)(SETTINGS_AT + offset), bytes);
}
