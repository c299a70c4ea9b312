// The port of the RP2040 and the RP2350, unchanged, on a model of each chip's rules. rom.c and, on the
// RP2040, flash.c call code of the chip's, and run in the emulator (tests/emulator).
#include "support.h"

#include "dma.h"
#include "map/store.h"
#include "only_board.h"
#include "pins.h"
#include "registers.h"
#include "rp2_rules.h"
#include "system.h"
#include "wire/sensor_gen.h"

BEFORE_EACH(new_chip)
{
    host_sends_frames = false;
    chip_reset();
    gpio_in = 1u << PIN_VBUS_SENSE;
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
    assert_in_range(facts.die_centi_c, 2600, 2800);
    assert_in_range(facts.supply_mv, 4740, 4760);
    registers_settle();
    assert_in_range(uart_bits_per_s(), 921600 * 99 / 100, 921600 * 101 / 100);
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
        assert_int_equal(word_bits, 16);
        (void)port_spi_transfer8(ONLY_BOARD, 0);
        assert_int_equal(word_bits, 8);
        assert_int_equal(sck_khz, is_khz[k]);
        port_spi_select(ONLY_BOARD, 0);
    }
    assert_true(broke(""));
}

#define LOW(n) (1u << PIN_SELECT_##n)

// All selected sensors hear the command, then each gives a word of its own and no other.
static void hears_a_slot(uint8_t mask)
{
    static const uint32_t pin[] = {LOW(0), LOW(1), LOW(2), LOW(3), LOW(4)};
    uint32_t all = 0, word = 1;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        all |= mask >> f & 1 ? pin[f] : 0;
    }
    registers_settle();
    assert_int_equal(words_heard, 1 + BT_MAX_FINGERS);
    assert_int_equal(heard[0] & (LOW(0) | LOW(1) | LOW(2) | LOW(3) | LOW(4)), all);
    for (int f = 0; f < BT_MAX_FINGERS; f++, word++) {
        assert_int_equal(heard[word], mask >> f & 1 ? pin[f] : 0);
    }
}

TEST(each_finger_hears_its_word_and_a_late_slot_is_given_up)
{
    static const uint8_t mask[] = {0x1F, 0x01, 0x12, 0x1F};
    uint16_t word[BT_MAX_FINGERS];
    start();
    for (unsigned k = 0; k < sizeof mask; k++) {
        words_heard = 0;
        (void)port_spi_slot_begin(ONLY_BOARD, 0x8000, mask[k]);
        hears_a_slot(mask[k]);
        assert_true(port_spi_slot_end(ONLY_BOARD, word));
        dma_is_late = true; // and the next slot is as any
        (void)port_spi_slot_begin(ONLY_BOARD, 0x8000, mask[k]);
        assert_false(port_spi_slot_end(ONLY_BOARD, word));
    }
    assert_true(broke(""));
}

#ifdef ON_rp2350
TEST(the_flash_tells_who_it_is_and_is_readable_after)
{
    rom_calls[0] = '\0';
    start();
    assert_string_equal(rom_calls, "IEFCIEFC");
    assert_memory_equal(flash_jedec_id, ((uint8_t[]){0xEF, 0x40, 0x16}), 3);
    const port_identity identity = port_identify(ONLY_BOARD);
    assert_memory_equal(identity.hello.board_serial,
                        ((uint8_t[]){0x25, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x2B, 0x2C}), 8);
    rom_calls[0] = '\0';
    static const uint8_t page[BT_FLASH_PAGE_BYTES];
    assert_true(port_flash_erase(ONLY_BOARD, 0) && port_flash_program(ONLY_BOARD, BT_STORAGE_BYTES, page));
    assert_string_equal(rom_calls, "IERFCIEPFC");
    assert_true(broke(""));
}

TEST(the_rom_restarts_it_into_its_loader)
{
    start();
    assert_true(rom_has_loader());
    registers_reset_at = (uint32_t)(uintptr_t)&WATCHDOG_CTRL;
    volatile int left = setjmp(registers_left);
    if (left == 0) {
        rom_enter_loader();
    }
    registers_reset_at = 0;
    assert_int_equal(left, 2);
    assert_true(broke(""));
}
#endif

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

// Dark: no clocks. Steady: main is not reached. Blinking: slow with a host's frames, fast without.
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
#ifdef ON_rp2350
    BREAKS("watchdog that resets", XOSC_STARTUP = 300, XOSC_CTRL = XOSC_CTRL_ENABLE);
    BREAKS("divider", CLK_SYS_CTRL = CLK_SYS_SRC_AUX);
    CLK_SYS_CTRL = 0;
    start();
    chip_reset();
#endif
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
    BREAKS("125 MHz", REG_SET(PLL_PWR(PLL_SYS_BASE)) = PLL_PWR_POSTDIVPD, CLK_SYS_CTRL = CLK_SYS_SRC_AUX);
    BREAKS("48 MHz", PLL_PRIM(PLL_USB_BASE) = 5u << 16 | 4u << 12, USB_SIE_CTRL = USB_SIE_PULLUP_EN);
    BREAKS("MISO's pull-down", PADS_BANK0_GPIO(PIN_MISO) = PADS_IE, SPI0_SSPDR = 0);
    BREAKS("an interrupt", interrupt_used(9));
    BREAKS("fed late", now_ns += 2100000000u, watchdog_feed());
    BREAKS("24 bits", WATCHDOG_LOAD = 1u << 24);
    BREAKS("two seconds", WATCHDOG_LOAD = 1000);
    BREAKS("nothing of ours", REG32(0x40004000u) = 0);
    BREAKS("SIO register", REG32(0xD0000008u) = 0);
    BREAKS("E5", DMA_CTRL(DMA_WORKER) = DMA_CHANNEL_EN, DMA_CHAN_ABORT = 1u << DMA_WORKER);
    BREAKS("control blocks", DMA_CTRL_TRIG(DMA_DEALER) = DMA_CHANNEL_EN);
    BREAKS("once a us", DMA_TIMER0 = 1u << 16 | 150);
    BREAKS("worker is off", bus_start(), DMA_CTRL(DMA_WORKER) &= ~DMA_CHANNEL_EN,
           (void)port_spi_slot_begin(ONLY_BOARD, 0, 1));
#ifdef ON_rp2350
    BREAKS("isolated", PADS_BANK0_GPIO(PIN_SCK) = 0x100, SPI0_SSPDR = 0);
    BREAKS("without a tick", TICKS_TIMER0_CTRL = 0, (void)TIMER_TIMERAWL);
    BREAKS("PHY", USB_MAIN_CTRL = USB_CONTROLLER_EN | 1u << 2);
    BREAKS("up and down", USB_SIE_CTRL = USB_SIE_PULLUP_EN | 1u << 15);
    BREAKS("joined", USB_MAIN_CTRL = 0, USB_SIE_CTRL = USB_SIE_PULLUP_EN);
    BREAKS("divider", CLK_PERI_DIV = 5u << 16, SPI0_SSPDR = 0);
    BREAKS("divider", CLK_ADC_DIV = 5u << 16, (void)ADC_CS);
    BREAKS("watchdog that resets", PSM_WDSEL = 0x0001FFFC, XOSC_CTRL = XOSC_CTRL_ENABLE);
    BREAKS("debugger", WATCHDOG_CTRL = WATCHDOG_ENABLE);
    BREAKS("direct mode", QMI_DIRECT_CSR = 0, QMI_DIRECT_TX = 0x9F);
    BREAKS("not come", (void)QMI_DIRECT_RX);
    BREAKS("has no room", QMI_DIRECT_CSR = 5, QMI_DIRECT_TX = 1, QMI_DIRECT_TX = 1, QMI_DIRECT_TX = 1,
           QMI_DIRECT_TX = 1, QMI_DIRECT_TX = 1);
    BREAKS("turns over", flash_start(), (void)port_flash_erase(ONLY_BOARD, 0));
    BREAKS("Arm Secure", (void)rom_function('U', 'B'));
#endif
}
