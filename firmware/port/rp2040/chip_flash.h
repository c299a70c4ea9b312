// This chip's part of flash.c: the flash's serial interface, an SSI, and boot2 to make it readable again.
#ifndef BIOTAC_RP2040_CHIP_FLASH_H
#define BIOTAC_RP2040_CHIP_FLASH_H

#include "rp2_regs.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define FLASH_BYTES    (2u * 1024 * 1024)
#define EXCHANGE_TURNS 100000u // 4.8 ms at least; an exchange lasts 20 us
#define SSI_FIFO       14      // bytes on their way; it holds 16
#define BOOT2_WORDS    64

typedef void (*rom_action)(void);

// boot2 in SRAM: it makes the flash readable again.
static uint32_t boot2_copy[BOOT2_WORDS];

static inline bool chip_flash_start(void)
{
    memcpy(boot2_copy, (const void *)(uintptr_t)XIP_BASE, sizeof boot2_copy);
    return true;
}

// After the ROM has emptied the cache.
static inline void chip_flash_readable(void)
{
    ((rom_action)((uintptr_t)boot2_copy | 1))(); // Thumb
}

// Sends a command and reads as many bytes as it sends, chip select held low throughout. False when the serial
// interface stopped in the middle. After exit_xip() it is serial with a byte a frame both ways, and empty
// (2.8.3.1.3; flash_init_spi in the ROM's source sets CTRLR0, BAUDR and SER).
static inline bool chip_flash_exchange(uint8_t command, volatile uint8_t *answer, uint32_t bytes)
{
    uint32_t sent = 0;
    uint32_t come = 0;
    IO_QSPI_SS_CTRL = (IO_QSPI_SS_CTRL & ~IO_QSPI_OUTOVER_BITS) | IO_QSPI_OUTOVER_LOW;
    for (uint32_t turn = 0; turn < EXCHANGE_TURNS && come < bytes; turn++) {
        uint32_t status = SSI_SR;
        if (sent < bytes && sent - come < SSI_FIFO && (status & SSI_SR_TFNF)) {
            SSI_DR0 = sent == 0 ? command : 0;
            sent++;
        }
        if (come < sent && (status & SSI_SR_RFNE)) {
            answer[come++] = (uint8_t)SSI_DR0;
        }
    }
    IO_QSPI_SS_CTRL = (IO_QSPI_SS_CTRL & ~IO_QSPI_OUTOVER_BITS) | IO_QSPI_OUTOVER_HIGH;
    IO_QSPI_SS_CTRL = IO_QSPI_SS_CTRL & ~IO_QSPI_OUTOVER_BITS; // back to the serial interface
    return come == bytes;
}

#endif
