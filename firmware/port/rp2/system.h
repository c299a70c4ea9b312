// Functions shared by the files of this port.
#ifndef BIOTAC_RP2_SYSTEM_H
#define BIOTAC_RP2_SYSTEM_H

#include "rp2_regs.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// ---- system.c
void watchdog_feed(void);     // boot2.S has started it
extern uint16_t early_faults; // port_rp2040.c: starts before this one that ended before port_init
uint16_t count_early_faults(void);

// ---- timer.c
void timer_start(void);

// ---- a gateway's side of the sensors' bus (slot.c), or the sensors', as the image needs
void bus_start(void);

// ---- spi.c
void spi_start(void);
void spi_reset(void); // from any state
uint32_t spi_khz(void);
extern uint32_t spi_control;           // SSPCR0 of a word, with port_spi_rate's rate from the next slot on
bool spi_is_slow(void);                // too slow for a slot by DMA
void spi_configure(uint32_t control);  // SSPCR0, before the next word
void spi_select_at_once(uint8_t mask); // port_spi_select without waits

// ---- rom.c: functions of the chip's boot ROM; NULL when it has none of that name
void *rom_function(char first, char second);
bool rom_has_loader(void);
void rom_enter_loader(void) __attribute__((noreturn));

// ---- flash.c
#define FLASH_ID_BYTES 8
// Before any interrupt is on. Saves the state needed to read the program again after the flash was used.
void flash_start(void);
// The slots for maps, or other data of the image there.
const uint8_t *flash_maps(void);
extern uint8_t flash_jedec_id[3];
extern uint32_t flash_erase_us; // the longest so far
// The flash's unique number, also the board's. False without one. Sets flash_jedec_id.
bool flash_identify(uint8_t id[FLASH_ID_BYTES]);

// ---- usb/
// serial: the serial number that the host shows; must stay valid.
void usb_start(const char *serial);

// Call often from the main loop: restarts a controller that hears nothing any more.
void usb_poll(void);
extern bool usb_receives_sof; // of a host
bool usb_all_sent(void);
extern volatile uint32_t usb_starts; // of frame

// port_link_turns, _write and _read for a host on USB.
uint32_t usb_turns(void);
bool usb_link_write(const uint8_t *data, size_t bytes);
size_t usb_link_read(uint8_t *data, size_t bytes);

// ---- uart.c
// bits_per_s: 120 to 7.8 million.
void uart_start(uint32_t bits_per_s);
bool uart_started(void);

// Accepts all bytes or none; false: no room.
bool uart_write(const uint8_t *data, size_t bytes);
size_t uart_read(uint8_t *data, size_t bytes);

// Call often from the main loop: sends written bytes, a run of the ring at a time.
void uart_poll(void);
bool uart_all_sent(void);

#endif
