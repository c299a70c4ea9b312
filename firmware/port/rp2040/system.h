// What the files of this port call of each other.
#ifndef BIOTAC_RP2040_SYSTEM_H
#define BIOTAC_RP2040_SYSTEM_H

#include "rp2040_regs.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Code that runs from flash, before all other is copied to SRAM. noinline, or it would end up in its caller,
// or what it calls in it.
#define AT_BOOT __attribute__((section(".boot_code"), noinline))

// ---- one interrupt held off, and no other: for who shares something with it
static inline void interrupt_hold_off(uint32_t number)
{
    NVIC_ICER = 1u << number;
    __asm volatile("dsb\n isb" ::: "memory");
}

static inline void interrupt_let_go(uint32_t number)
{
    __asm volatile("" ::: "memory");
    NVIC_ISER = 1u << number;
}

// ---- all of them, for the few cycles in which two must see the same
static inline uint32_t interrupts_disable(void)
{
    uint32_t primask;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(primask)::"memory");
    return primask;
}

static inline void interrupts_restore(uint32_t primask)
{
    __asm volatile("msr primask, %0" ::"r"(primask) : "memory");
}

// ---- startup.c: who takes an interrupt, beside the timer's and the USB's
void use_interrupt(uint32_t number, void (*handler)(void));

// ---- image_note.c: of the image in flash; see port.h
uint32_t image_crc32(void);

// ---- system.c: clocks, watchdog, reset
// CLK_SYS_HZ from the crystal, 48 MHz for USB, the 1 us tick; false when the crystal or a PLL never came up.
bool clocks_start(void);
void watchdog_start(void);
void watchdog_feed(void);
void system_reset(void) __attribute__((noreturn));

// ---- timer.c
void timer_start(void);
void timer_interrupt(void);

// Sleep until an interrupt calls timer_wake, or not at all when one has since the last call.
void timer_sleep(void);

// Something came that the main loop should look at; port_idle will not sleep over it. For interrupts.
void timer_wake(void);

// ---- what the image is for: a gateway's side of the sensors' bus (slot.c), or the sensors'
void bus_start(void);

// ---- spi.c
void spi_start(void);
void spi_reset(void);                  // whatever it was about
void spi_select_at_once(uint8_t mask); // port_spi_select without its waits

// ---- rom.c: functions of the chip's boot ROM; NULL when it has none of that name
void *rom_function(char first, char second);
bool rom_has_loader(void);
void rom_enter_loader(void) __attribute__((noreturn));

// ---- flash.c
#define FLASH_ID_BYTES 8
// Before any interrupt is on. Keeps what is needed to read the program again after the flash was used.
void flash_start(void);
// The flash's own unique number, which is the board's. False when the flash tells none.
bool flash_unique_id(uint8_t id[FLASH_ID_BYTES]);

// ---- usb/
// serial: text that stays; what the host shows as the serial number.
void usb_start(const char *serial);
void usb_interrupt(void);

// In the main loop, often: start over a controller that hears nothing any more.
void usb_watch(void);
bool usb_all_sent(void);

// port_link_up, _write and _read for a host on USB.
bool usb_link_up(void);
bool usb_link_write(const uint8_t *data, size_t bytes);
size_t usb_link_read(uint8_t *data, size_t bytes);

// Once: a host set 1200 baud and let DTR go, the customary sign to enter the loader.
bool usb_touched(void);

// ---- uart.c
// bits_per_s: 120 to 7.8 million. pins: an enum bt_uart_pins.
void uart_start(uint32_t bits_per_s, uint32_t pins);
bool uart_started(void);

// Takes all bytes or none; false means no room.
bool uart_write(const uint8_t *data, size_t bytes);
size_t uart_read(uint8_t *data, size_t bytes);
void uart_forget_heard(void);

// In the main loop, often: what is written goes out a run of the ring at a time.
void uart_watch(void);
bool uart_all_sent(void);

#endif
