// Everything the firmware needs from a board, on one page. Each folder beside this file has one
// implementation; README.md beside it lists the callers and their contexts. Times are us of device time in
// uint32_t, wrapping; differences are modulo 2^32.
#ifndef BIOTAC_PORT_H
#define BIOTAC_PORT_H

#include "wire/messages_gen.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// A board, as its port defines it. Most ports know only one and ignore the argument (only_board.h); a program
// may hold several of Linux's (host/binding/sbc.c).
typedef struct bt_port bt_port;

// Call once, before anything else. argc and argv are for boards that have a command line.
bt_port *port_init(int argc, char **argv);

// ---- time -----------------------------------------------------------------------------------
uint32_t port_now_us(bt_port *port); // since the board's start, which powers the sensors

// Busy wait: a few us between reads, and once the sensors' power-up time.
void port_delay_us(bt_port *port, uint32_t us);

// Call bt_port_alarm() from interrupt context once `at_us` has come; replaces an earlier alarm.
void port_alarm_at(bt_port *port, uint32_t at_us);

// Defined by the app. Runs in interrupt context. True when the main loop has something to do.
bool bt_port_alarm(void);

// Sleep until an interrupt may have brought work.
void port_idle(bt_port *port);

// ---- SPI ------------------------------------------------------------------------------------
// Pull low the chip selects of the sensors in mask, release all others. The board's pins.h has the waits
// before and after a word; a word may be sent on return.
void port_spi_select(bt_port *port, uint8_t mask);

// Exchange 16 bits, MSB first, mode 0, BT_SPI_HZ. Returns the bits on MISO.
uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi);

// The same with 8 bits, for sensors that send properties byte by byte.
uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi);

// Begin a whole slot, if the board's hardware can do it: the command to the sensors of mask at once,
// BT_SETTLE_US later BT_LISTEN_WORD to each of them, BT_GAP_US apart. Returns the us until port_spi_slot_end
// may be called; 0 if the core must do it word by word (spi_word_by_word.h).
uint32_t port_spi_slot_begin(bt_port *port, uint16_t command, uint8_t mask);

// The sensors' answers: BT_MAX_FINGERS words, 0 for sensors not in mask. False if one was late: words cannot
// be matched to sensors then.
bool port_spi_slot_end(bt_port *port, uint16_t *word);

// ---- links to hosts -------------------------------------------------------------------------
// Link 0 is USB, or the only link of a board; link 1 a UART.
#define PORT_LINKS 2

// Accepts all bytes or none; false: no room, or no host.
bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes);

// Returns the number of bytes read.
size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes);

// Counts how often the link was opened and closed: odd while a host has it open (DTR; a UART is open once
// started). A close and open between two calls shows as well.
uint32_t port_link_turns(bt_port *port, unsigned link);

// Start the UART, or change its rate, in bits per second. 0: off or, on a board without another link, the
// port's default, so that such a board is never mute. No effect on a board without a UART.
void port_link_uart(bt_port *port, uint32_t bits_per_s);

// True once after a host set link 0 to 1200 baud and closed it, the customary way to ask for the bootloader.
bool port_link_touched(bt_port *port);

// ---- flash for settings and maps ------------------------------------------------------------
// Storage for the core, as one run of bytes: two sectors of settings (keep/storage.h), then the slots for
// maps (map/store.h), if any. The port maps it to a chip. Erasing and programming may hold off interrupts for
// as long as an erase lasts, and return false if the flash failed.
bool port_flash_erase(bt_port *port, uint32_t sector_offset);
bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page);
void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes);

// Restart, into the bootloader or into the firmware again, once bytes written to the link are out or after a
// short while. False if this board cannot.
bool port_reboot(bt_port *port, bool into_bootloader);

// ---- measurements by a board of its own hardware, for bring-up --------------------------------
// Fill in the facts that this board knows. All others are preset to unknown, bus_khz to the usual rate;
// slots_dma_late is the sampler's.
void port_measure(bt_port *port, bt_msg_board_facts *facts);

// From the next slot on, clock SPI at the fastest rate up to this one, or the slowest, some 1 MHz; 0: the
// usual one. No effect where the rate is fixed.
void port_spi_rate(bt_port *port, uint32_t khz);

// ---- identity -------------------------------------------------------------------------------
#define PORT_KEPT_BYTES 1056
typedef struct {
    // board, or a private id from BT_BOARD_PRIVATE on; board_serial, board_name; boot_id, random at each
    // boot; image_crc32 of the running image, read where it is stored, 0xFFFFFFFF for none.
    bt_msg_hello hello;
    uint16_t started_by; // BT_FAULT_FLAG_STARTED, HUNG or CRASHED
    // PORT_KEPT_BYTES, aligned to 4, which outlive a hang or a crash; NULL: none. Random after power-on.
    void *kept;
} port_identity;
port_identity port_identify(bt_port *port);

// ---- abilities: constants of the port, reported to the host ----------------------------------
typedef struct {
    uint8_t fingers;      // chip selects: 1 to BT_MAX_FINGERS
    uint32_t erase_bytes; // flash is erased in these: 4 KiB or more, a multiple of BT_FLASH_PAGE_BYTES
    // Bytes of the largest wrench map: a multiple of 4, at most BT_MAP_MAX_BYTES. 0: no maps, so no slots in
    // flash and nothing below.
    uint16_t map_bytes;
    uint8_t *map_ram;    // fingers * map_bytes, aligned to 4: the maps in force
    const uint8_t *maps; // all slots as memory, aligned to 4, which changes with the flash
    bool no_bus;         // rounds come from elsewhere, whole: nothing is sampled, and no sensor is asked
    bool untimed;        // and with unknown sampling times
} port_abilities;
port_abilities port_describe(bt_port *port);

#endif
