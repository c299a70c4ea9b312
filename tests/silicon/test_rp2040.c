// The RP2040's port, unchanged, on a model of its chip's rules. rom.c and flash.c call code of the chip's,
// and run in the emulator (tests/emulator).
#include "support.h"

#include "only_board.h"
#include "pins.h"
#include "registers.h"
#include "rp2040_rules.h"
#include "system.h"
#include "wire/sensor_gen.h"

static int new_chip(void **state)
{
    (void)state;
    host_sends_frames = false;
    chip_reset();
    gpio_in = 1u << PIN_VBUS_SENSE;
    return 0;
}

static bt_msg_board_facts facts;

static void start(void)
{
    watchdog_feed();
    assert_true(clocks_start());
    (void)port_init(0, NULL);
}

TEST(it_starts_by_the_rules)
{
    start();
    port_alarm_at(ONLY_BOARD, port_now_us(ONLY_BOARD) + 1000);
    port_link_uart(ONLY_BOARD, 921600);
    port_idle(ONLY_BOARD);
    port_measure(ONLY_BOARD, &facts);
    assert_true(broke(""));
}

TEST(words_and_bytes_at_every_rate)
{
    static const uint32_t khz[] = {0, 1000, 2000, 4500, 9000, 0},
                          is_khz[] = {4464, 992, 1953, 4464, 8928, 4464};
    uint16_t word[BT_MAX_FINGERS];
    start();
    for (unsigned k = 0; k < sizeof khz / sizeof *khz; k++) {
        port_spi_rate(ONLY_BOARD, khz[k]);
        port_measure(ONLY_BOARD, &facts);
        assert_int_equal(facts.bus_khz, is_khz[k]);
        const bool by_core = is_khz[k] < 4400; // the DMA's steps have no time for slower words
        assert_int_equal(port_spi_slot_begin(ONLY_BOARD, 0x8000, 1) == 0, by_core);
        if (!by_core) {
            (void)port_spi_slot_end(ONLY_BOARD, word);
        }
        port_spi_select(ONLY_BOARD, 1);
        (void)port_spi_transfer16(ONLY_BOARD, 0x8000);
        (void)port_spi_transfer8(ONLY_BOARD, 0);
        port_spi_select(ONLY_BOARD, 0);
    }
    assert_true(broke(""));
}

static void run_ms(int ms)
{
    for (int k = 0; k < ms; k++) {
        port_idle(ONLY_BOARD);
    }
}

TEST(a_sense_pin_that_bounces_does_not_take_the_board_off_the_bus)
{
    start();
    host_sends_frames = true;
    run_ms(30);
    const uint32_t before = usb_resets;
    for (int k = 0; k < 100; k++) {
        gpio_in = k % 2 ? 1u << PIN_VBUS_SENSE : 0;
        run_ms(4);
    }
    assert_int_equal(usb_resets, before);
    gpio_in = 0;
    run_ms(30);
    assert_int_equal(usb_resets, before + 1);
}

// Dark: no clocks. Steady: main is not reached. Then it blinks, slowly with a host's frames, fast without.
TEST(the_led_tells_four_states)
{
    assert_false(gpio_out >> PIN_LED & 1);
    assert_true(clocks_start());
    registers_settle();
    assert_true(gpio_out >> PIN_LED & 1);
    (void)port_init(0, NULL);
    run_ms(100);
    for (int hosts = 0; hosts < 2; hosts++) {
        int changes = 0;
        host_sends_frames = hosts;
        run_ms(100);
        for (int k = 0; k < 2000; k++) {
            const uint32_t before = gpio_out;
            port_idle(ONLY_BOARD);
            registers_settle();
            changes += (before ^ gpio_out) >> PIN_LED & 1;
        }
        assert_in_range(changes, hosts ? 3 : 14, hosts ? 4 : 16);
    }
}

#define BREAKS(part, ...) __VA_ARGS__, assert_true(broke(part))

TEST(each_rule_can_be_broken)
{
    BREAKS("in reset", (void)SYSINFO_CHIP_ID);
    BREAKS("less than 6 ms", XOSC_STARTUP = 47, XOSC_CTRL = XOSC_CTRL_ENABLE);
    BREAKS("not locked", CLK_SYS_CTRL = CLK_SYS_SRC_AUX);
    start();
    BREAKS("changed under clk_sys", PLL_FBDIV_INT(PLL_SYS_BASE) = 100);
    BREAKS("outside of 750", PLL_FBDIV_INT(PLL_USB_BASE) = 40);
    BREAKS("format changed while enabled", SPI0_SSPCR0 = 0);
    BREAKS("odd", SPI0_SSPCPSR = 3);
    BREAKS("without a pull", PADS_BANK0_GPIO(PIN_VBUS_SENSE) = PADS_IE | PADS_SCHMITT, (void)SIO_GPIO_IN);
    BREAKS("input enable", PADS_BANK0_GPIO(PIN_VBUS_SENSE) = 0, (void)SIO_GPIO_IN);
    BREAKS("DBGPAUSE", TIMER_DBGPAUSE = 7, port_alarm_at(ONLY_BOARD, 0));
    BREAKS("fed late", now_ns += 2100000000u, watchdog_feed());
    BREAKS("24 bits", WATCHDOG_LOAD = 1u << 24);
}

int main(void)
{
    return run_all(NULL, new_chip);
}
