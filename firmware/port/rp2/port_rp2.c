// The RP2040 without a vendor's SDK: start-up in order, identity, and the main loop's rest.
#include "only_board.h"

#include "pins.h"
#include "system.h"
#include "wire/crc32.h"
#include "wire/messages_gen.h"

#include "rp2_regs.h"

#include <string.h>

#define RANDOM_BYTES 64

// Wait of a reboot into the loader: at least until the host has the answer to a control request, at most
// until it obviously does not read.
#define LEAVE_AFTER_US  10000u
#define LEAVE_LATEST_US 200000u

static const char no_id[] = "no-flash-id";
static uint8_t unique_id[FLASH_ID_BYTES];
static bool has_id;
static char serial_text[2 * FLASH_ID_BYTES + 1];
static uint32_t boot_id;
static uint16_t started_by;
uint16_t early_faults;
static bool leaving, into_loader;
static uint32_t leave_us;

static void make_serial_text(void)
{
    static const char digits[] = "0123456789ABCDEF";
    if (!has_id) {
        memcpy(serial_text, no_id, sizeof no_id);
        return;
    }
    for (int k = 0; k < FLASH_ID_BYTES; k++) {
        serial_text[2 * k] = digits[unique_id[k] >> 4];
        serial_text[2 * k + 1] = digits[unique_id[k] & 15];
    }
}

// Random at each boot. The ring oscillator's bit is biased and neighbours are alike, so many go through a
// CRC, with a count that survives every reset but power-on: two boots in a row differ even where the bit is
// stuck.
static void make_boot_id(void)
{
    uint8_t noise[RANDOM_BYTES + FLASH_ID_BYTES + 4];
    for (int k = 0; k < RANDOM_BYTES; k++) {
        uint32_t byte = 0;
        for (int bit = 0; bit < 8; bit++) {
            byte = byte << 1 | (ROSC_RANDOMBIT & 1);
        }
        noise[k] = (uint8_t)byte;
    }
    memcpy(noise + RANDOM_BYTES, unique_id, FLASH_ID_BYTES);
    uint32_t boots = WATCHDOG_SCRATCH0 + 1;
    WATCHDOG_SCRATCH0 = boots;
    for (int k = 0; k < 4; k++) {
        noise[RANDOM_BYTES + FLASH_ID_BYTES + k] = (uint8_t)(boots >> 8 * k);
    }
    boot_id = bt_crc32(noise, sizeof noise);
}

// In scratch 1 while this firmware runs: other images, and the loader, reset the chip by its watchdog too.
#define RUNNING 0x42544757u // "WGTB"

static void note_start(void)
{
    const uint32_t reason = WATCHDOG_REASON;
    if (WATCHDOG_SCRATCH1 != RUNNING || reason == 0) {
        started_by = BT_FAULT_FLAG_STARTED;
    } else {
        started_by = reason & WATCHDOG_TIMED_OUT ? BT_FAULT_FLAG_HUNG : BT_FAULT_FLAG_CRASHED;
    }
    WATCHDOG_SCRATCH1 = RUNNING;
    early_faults = count_early_faults();
    started_by |= early_faults != 0 ? BT_FAULT_FLAG_EARLY_FAULT : 0;
}

bt_port *port_init(int argc, char **argv)
{
    note_start();
    flash_start();
    has_id = flash_identify(unique_id);
    watchdog_feed();
    make_serial_text();
    make_boot_id();
    bus_start();
    timer_start();
    usb_start(serial_text);
    return ONLY_BOARD;
}

void port_idle(bt_port *port)
{
    uint32_t since_us = port_now_us(port) - leave_us;
    bool all_sent = usb_all_sent() && uart_all_sent();
    if (leaving && since_us >= LEAVE_AFTER_US && (all_sent || since_us >= LEAVE_LATEST_US)) {
        WATCHDOG_SCRATCH1 = 0;
        if (into_loader) {
            rom_enter_loader();
        }
        system_reset();
    }
    usb_poll();
    uart_poll();
#ifdef PIN_LED
    const uint32_t lit =
        port_now_us(port) >> (usb_receives_sof ? 19 : 17) & 1; // s/2 or s/8: a host's frames, none
    SIO_GPIO_OUT_SET = lit << PIN_LED;
    SIO_GPIO_OUT_CLR = (lit ^ 1) << PIN_LED;
#endif
    watchdog_feed(); // only here and before a flash erase: a main loop that hangs ends in a reset
    sleep_until_woken();
}

bool port_reboot(bt_port *port, bool into_bootloader)
{
    if (into_bootloader && !rom_has_loader()) {
        return false;
    }
    if (!leaving) {
        leaving = true;
        into_loader = into_bootloader;
        leave_us = port_now_us(port);
    }
    return true;
}

port_identity port_identify(bt_port *port)
{
    static uint32_t kept[PORT_KEPT_BYTES / 4] __attribute__((section(".kept"))); // neither zeroed nor copied
    port_identity identity = {
        .hello = {.board = IMAGE_BOARD,
                  .board_name = IMAGE_BOARD_NAME,
                  .boot_id = boot_id,
                  .image_crc32 = image_crc32()},
        .started_by = started_by,
        .kept = kept,
    };
    memcpy(identity.hello.board_serial, has_id ? (const void *)unique_id : no_id,
           has_id ? FLASH_ID_BYTES : sizeof no_id - 1);
    return identity;
}
