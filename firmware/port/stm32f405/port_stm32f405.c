// Start-up in order, identity and abilities, and the main loop's rest.
#include "only_board.h"

#include "pins.h"
#include "stm32f405.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <string.h>

#define SETTINGS_SECTOR_BYTES 16384u
#define RANDOM_TURNS          10000u

// Longest wait of a restart for bytes written before.
#define LEAVE_LATEST_US 200000u

static uint32_t boot_id;
static uint16_t why_started;
static enum { STAYS, TO_LOADER, TO_ITSELF } leaving;
static uint32_t leave_us;

// The chip's first vectors; the image begins behind the settings.
extern uint32_t image_stack_top[];
void image_reset(void);
__attribute__((section(".boot_vectors"), used)) static void (*const boot_vectors[2])(void) = {
    (void (*)(void))image_stack_top, image_reset};

bt_port *port_init(int argc, char **argv)
{
    why_started = started_by();
    watchdog_start();
    clock_start();
    pin_output(PORT_LED, PIN_LED);
    GPIO_BSRR(PORT_LED) = 1u << PIN_LED;
    RNG_CR = RNG_CR_RNGEN;
    boot_id = wait_for(&RNG_SR, RNG_SR_DRDY, RNG_SR_DRDY, RANDOM_TURNS) ? RNG_DR : 0;
    systick_alarm_start(HCLK_HZ);
    spi_start();
    return ONLY_BOARD;
}

void port_idle(bt_port *port)
{
    if (leaving != STAYS && (uart_all_sent() || clock_us() - leave_us >= LEAVE_LATEST_US)) {
        restart(leaving == TO_LOADER);
    }
    uart_poll();
    // Slow once a host was heard, fast before; dark without clocks, steady where this loop is not reached.
    const uint32_t lit = clock_us() >> (uart_received ? 19 : 17) & 1;
    GPIO_BSRR(PORT_LED) = 1u << (PIN_LED + (lit ? 0 : 16));
    watchdog_feed(); // only here and before a flash erase: a main loop that hangs ends in a reset
    sleep_until_woken();
}

bool port_reboot(bt_port *port, bool into_bootloader)
{
    if (leaving == STAYS) {
        leaving = into_bootloader ? TO_LOADER : TO_ITSELF;
        leave_us = clock_us();
    }
    return true;
}

void port_measure(bt_port *port, bt_msg_board_facts *facts)
{
    facts->t_us = clock_us();
    facts->chip_id = DBGMCU_IDCODE;
    facts->erase_us = flash_erase_us;
    facts->bus_khz = (uint16_t)spi_khz();
}

port_identity port_identify(bt_port *port)
{
    static uint32_t kept[PORT_KEPT_BYTES / 4] __attribute__((section(".noinit")));
    port_identity identity = {
        .hello = {.board = IMAGE_BOARD,
                  .board_name = IMAGE_BOARD_NAME,
                  .boot_id = boot_id,
                  .image_crc32 = image_crc32()},
        .started_by = why_started,
        .kept = kept,
    };
    for (int k = 0; k < 3; k++) {
        uint32_t word = UNIQUE_ID[k];
        memcpy(identity.hello.board_serial + 4 * k, &word, 4);
    }
    return identity;
}

port_abilities port_describe(bt_port *port)
{
    // No maps: a flash in sectors of 128 KiB has no room for eleven slots with an erase of their own.
    return (port_abilities){.fingers = BT_MAX_FINGERS, .erase_bytes = SETTINGS_SECTOR_BYTES};
}
