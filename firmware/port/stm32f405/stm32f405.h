// Functions shared by the files of this port.
#ifndef BIOTAC_STM32F405_H
#define BIOTAC_STM32F405_H

#include "stm32f405_regs.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// A block responds some cycles after its clock is on (ES0182); the read waits that long.
static inline void clock_on(volatile uint32_t *enable, uint32_t blocks)
{
    *enable |= blocks;
    (void)*enable;
}

// Turns of wait_for, of six cycles at least: 40 ns at 144 MHz, 375 ns on the oscillator that the chip starts
// with.
#define WAIT_CLOCKS_TURNS 100000u   // 37 ms at least: the crystal needs some
#define WAIT_FLASH_TURNS  25000000u // a second: a sector of 16 KiB needs 0.5 s at most (data sheet 5.3.12)
#define WAIT_SPI_TURNS    1000u     // 40 us: a word lasts 3.6

// ---- clocks.c
void clock_start(void); // of clock_us
void watchdog_start(void);
void watchdog_feed(void);
void restart(bool to_loader) __attribute__((noreturn)); // by a reset: into the ROM's loader, or back here
uint16_t started_by(void);                              // once: BT_FAULT_FLAG_STARTED, HUNG or CRASHED

// ---- pins, by port (0: A) and number
static inline void pin_output(uint32_t port, uint32_t pin)
{
    GPIO_OSPEEDR(port) |= 1u << 2 * pin;
    GPIO_MODER(port) = (GPIO_MODER(port) & ~(3u << 2 * pin)) | 1u << 2 * pin;
}

enum pull { PULL_NONE, PULL_UP, PULL_DOWN };

static inline void pin_function(uint32_t port, uint32_t pin, uint32_t function, enum pull pull)
{
    const uint32_t at = 4 * (pin % 8);
    GPIO_AFR(port, pin / 8) = (GPIO_AFR(port, pin / 8) & ~(15u << at)) | function << at;
    GPIO_OSPEEDR(port) |= 1u << 2 * pin;
    GPIO_PUPDR(port) = (GPIO_PUPDR(port) & ~(3u << 2 * pin)) | (uint32_t)pull << 2 * pin;
    GPIO_MODER(port) = (GPIO_MODER(port) & ~(3u << 2 * pin)) | 2u << 2 * pin;
}

// ---- spi.c
void spi_start(void);
uint32_t spi_khz(void);

// ---- uart.c
extern volatile bool uart_received; // a byte, so far
void uart_poll(void);
bool uart_all_sent(void);

// ---- flash.c
extern uint32_t flash_erase_us; // the longest so far

#endif
