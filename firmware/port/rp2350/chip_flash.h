// This chip's part of flash.c: the flash's serial interface, QMI, and the ROM's way back to reads.
#ifndef BIOTAC_RP2350_CHIP_FLASH_H
#define BIOTAC_RP2350_CHIP_FLASH_H

#include "rp2_regs.h"
#include "system.h"

#define FLASH_BYTES    (4u * 1024 * 1024)
#define EXCHANGE_TURNS 100000u // 4.8 ms at least; an exchange lasts 20 us

typedef void (*rom_action)(void);
static rom_action rom_read_again; // "CX": reads by 03h at a slow clock, which every flash knows

static inline bool chip_flash_start(void)
{
    rom_read_again = (rom_action)rom_function('C', 'X');
    return rom_read_again != NULL;
}

// After the ROM has emptied the cache.
static inline void chip_flash_readable(void)
{
    rom_read_again();
}

// As on the RP2040. In direct mode QMI moves a byte each way through a short FIFO (12.14.5), and waits while
// received bytes have no room. After exit_xip() the clock suits every flash.
static inline bool chip_flash_exchange(uint8_t command, volatile uint8_t *answer, uint32_t bytes)
{
    uint32_t sent = 0;
    uint32_t come = 0;
    REG_SET(QMI_DIRECT_CSR) = QMI_DIRECT_CSR_EN;
    REG_SET(QMI_DIRECT_CSR) = QMI_DIRECT_CSR_ASSERT_CS;
    for (uint32_t turn = 0; turn < EXCHANGE_TURNS && come < bytes; turn++) {
        uint32_t status = QMI_DIRECT_CSR;
        if (sent < bytes && !(status & QMI_DIRECT_CSR_TXFULL)) {
            QMI_DIRECT_TX = sent == 0 ? command : 0;
            sent++;
        }
        if (come < sent && !(status & QMI_DIRECT_CSR_RXEMPTY)) {
            answer[come++] = (uint8_t)QMI_DIRECT_RX;
        }
    }
    REG_CLR(QMI_DIRECT_CSR) = QMI_DIRECT_CSR_ASSERT_CS;
    REG_CLR(QMI_DIRECT_CSR) = QMI_DIRECT_CSR_EN;
    return come == bytes;
}

#endif
