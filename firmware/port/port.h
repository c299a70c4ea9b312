// Everything the firmware needs of a board, on one page. One implementation per folder beside this.
// Times are us of device time in uint32_t, wrapping; differences are taken modulo 2^32.
#ifndef BIOTAC_PORT_H
#define BIOTAC_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Once, before anything else. argc and argv are for boards that have a command line.
void port_init(int argc, char **argv);

// ---- time -----------------------------------------------------------------------------------
uint32_t port_now_us(void);

// Busy wait: a few us between reads, and once the sensors' power-up time.
void port_delay_us(uint32_t us);

// Call bt_port_alarm() from interrupt context once `at_us` has come; replaces an earlier alarm.
void port_alarm_at(uint32_t at_us);

// Defined by the app. Runs in interrupt context. True when the main loop has something to do.
bool bt_port_alarm(void);

// Sleep until an interrupt may have brought work.
void port_idle(void);

// ---- SPI ------------------------------------------------------------------------------------
// Pull low the chip selects of the sensors in mask, release all others. A board's constants say how long
// before a word and after it (its pins.h); when it returns, a word may be sent.
void port_spi_select(uint8_t mask);

// Exchange 16 bits, MSB first, mode 0, BT_SPI_HZ. Returns what MISO carried.
uint16_t port_spi_transfer16(uint16_t mosi);

// The same with 8 bits: a property's bytes come one by one.
uint8_t port_spi_transfer8(uint8_t mosi);

// A whole slot, where the board's hardware can: the command to the sensors of mask at once, BT_SETTLE_US
// later BT_LISTEN_WORD to each of them, BT_GAP_US apart. Returns how many us until it is over and
// port_spi_slot_end may be called; 0 where the core must do it word by word (spi_word_by_word.h).
uint32_t port_spi_slot_begin(uint16_t command, uint8_t mask);

// What they said: BT_MAX_FINGERS words, 0 of those not in mask, and of all when a word was late.
void port_spi_slot_end(uint16_t *word);

// ---- link to the host -----------------------------------------------------------------------
// Takes all bytes or none; false means no room, or nobody there.
bool port_link_write(const uint8_t *data, size_t bytes);

// Returns how many bytes came, 0 when none did.
size_t port_link_read(uint8_t *data, size_t bytes);

// A host has the port open (DTR), or there is a UART. False for once when the one takes over from the other.
bool port_link_up(void);

// Besides, for while no host has the port open, a UART: bits a second, 0 for none, and an enum bt_uart_pins.
// Once. Nothing where a board has none.
void port_link_uart(uint32_t bits_per_s, uint32_t pins);

// ---- flash for settings and maps ------------------------------------------------------------
// What the core wants kept, as one run of bytes: settings (keep/storage.h), behind them the slots for maps
// (map/store.h, which has the sum). Where that lies in which chip is the port's affair. Interrupts may be
// held off while erasing and programming, for up to 0.4 s. False when the flash did not do it.
bool port_flash_erase(uint32_t sector_offset);
bool port_flash_program(uint32_t page_offset, const uint8_t *page);
void port_flash_read(uint32_t offset, uint8_t *data, size_t bytes);

// The slots for maps as memory, which changes as they are erased and programmed. Aligned to 4 bytes.
const uint8_t *port_flash_maps(void);

// Leave for the loader as soon as what was written to the link is out, or after a short while. False when
// this board has none.
bool port_reboot_bootloader(void);

// ---- identity -------------------------------------------------------------------------------
uint16_t port_board(void); // enum bt_board
void port_board_serial(uint8_t serial[12]);
uint32_t port_boot_id(void);    // random at each boot
uint16_t port_started_by(void); // BT_FAULT_FLAG_STARTED, HUNG or CRASHED
// CRC-32 of the image that runs, read where it is stored; 0xFFFFFFFF where there is no image.
uint32_t port_image_crc32(void);

#endif
