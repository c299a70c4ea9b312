// The F405's port, unchanged, on a model of the chip's rules.
#include "support.h"

#include "only_board.h"
#include "pins.h"
#include "registers.h"
#include "stm32f405.h"
#include "stm32f405_rules.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

BEFORE_EACH(new_chip)
{
    chip_reset(false);
}

static bt_msg_board_facts facts;

static void start(bool by_loader)
{
    chip_reset(by_loader);
    assert_true(clocks_start());
    assert_int_equal(hclk_hz(), 144000000);
    (void)port_init(0, NULL);
    port_link_uart(ONLY_BOARD, 0);
}

TEST(its_uart_has_the_rates_of_the_setting)
{
    static const uint32_t rates[] = {1200, 115200, 921600, 1500000, 2250000, 3000000};
    start(false);
    for (unsigned k = 0; k < sizeof rates / sizeof *rates; k++) {
        port_link_uart(ONLY_BOARD, rates[k]);
        const uint32_t brr = USART3_BRR, clocks = USART3_CR1 >> 15 & 1 ? (brr >> 4) * 8 + (brr & 7) : brr;
        assert_in_range(hclk_hz() / 4 / clocks, rates[k] / 100 * 98, rates[k] / 100 * 102);
    }
    assert_true(broke(""));
}

TEST(it_starts_by_the_rules)
{
    start(false);
    assert_true(broke(""));
    assert_non_null(port_identify(ONLY_BOARD).kept); // tares outlive a hang of the board
}

TEST(it_starts_from_what_the_loader_left)
{
    start(true);
    assert_true(broke(""));
    for (int k = 0; k < 4; k++) {
        assert_int_equal(nvic_enabled[k] & ~(k == 1 ? 1u << (USART3_IRQ - 32) : 0), 0);
    }
}

TEST(it_tells_a_hang_and_a_crash_from_a_start)
{
    const uint32_t by_pin = 1u << 26;
    start(false);
    RCC_CSR = by_pin | RCC_CSR_IWDGRSTF;
    assert_int_equal(started_by(), BT_FAULT_FLAG_HUNG);
    RCC_CSR = by_pin | RCC_CSR_SFTRSTF;
    assert_int_equal(started_by(), BT_FAULT_FLAG_CRASHED);
    RCC_CSR = by_pin;
    assert_int_equal(started_by(), BT_FAULT_FLAG_STARTED);
    if (setjmp(registers_left) == 0) {
        restart(false);
    }
    RCC_CSR = by_pin | RCC_CSR_SFTRSTF;
    assert_int_equal(started_by(), BT_FAULT_FLAG_STARTED);
}

TEST(it_leaves_for_the_loader_as_out_of_reset)
{
    start(false);
    if (setjmp(registers_left) == 0) {
        restart(true);
    }
    chip_reset(false);
    volatile int left = setjmp(registers_left);
    if (left == 0) {
        (void)clocks_start();
    }
    assert_int_equal(left, 2);
    assert_true(broke(""));
}

TEST(words_and_bytes_at_every_rate)
{
    static const uint32_t khz[] = {0, 1000, 2500, 4500, 9000, 0},
                          is_khz[] = {4500, 1125, 2250, 4500, 9000, 4500};
    start(false);
    for (unsigned k = 0; k < sizeof khz / sizeof *khz; k++) {
        port_spi_rate(ONLY_BOARD, khz[k]);
        port_measure(ONLY_BOARD, &facts);
        assert_int_equal(facts.bus_khz, is_khz[k]);
        port_spi_select(ONLY_BOARD, 1);
        (void)port_spi_transfer16(ONLY_BOARD, 0x8000);
        (void)port_spi_transfer8(ONLY_BOARD, 0);
        port_spi_select(ONLY_BOARD, 0);
    }
    assert_true(broke(""));
}

TEST(the_flash_by_the_rules_and_the_watchdog_is_fed_over_it)
{
    uint8_t page[256], back[256];
    memset(page, 0x5A, sizeof page);
    start(true);
    for (int k = 0; k < 4; k++) {
        assert_true(port_flash_erase(ONLY_BOARD, 16384 * (k % 2)));
        assert_true(port_flash_program(ONLY_BOARD, 16384 * (k % 2), page));
        port_flash_read(ONLY_BOARD, 16384 * (k % 2), back, sizeof back);
        assert_memory_equal(page, back, sizeof page);
    }
    assert_true(broke(""));
}

// As on the Pico, but the port that is heard is the UART: a byte of it.
TEST(the_led_tells_four_states)
{
    assert_true(clocks_start());
    registers_settle();
    assert_false(gpio_c_out >> PIN_LED & 1);
    (void)port_init(0, NULL);
    registers_settle();
    assert_true(gpio_c_out >> PIN_LED & 1);
    for (int heard = 0; heard < 2; heard++) {
        int changes = 0;
        uart_received = heard;
        port_idle(ONLY_BOARD);
        for (int k = 0; k < 2000; k++) {
            const uint32_t before = gpio_c_out;
            port_idle(ONLY_BOARD);
            registers_settle();
            changes += (before ^ gpio_c_out) >> PIN_LED & 1;
        }
        assert_in_range(changes, heard ? 3 : 14, heard ? 4 : 16);
    }
    assert_true(broke(""));
}

#define BREAKS(part, ...) __VA_ARGS__, assert_true(broke(part))

TEST(each_rule_can_be_broken)
{
    BREAKS("crystal is ready", RCC_PLLCFGR |= RCC_PLLCFGR_FROM_HSE, RCC_CR |= RCC_CR_PLLON);
    BREAKS("not ready", RCC_CFGR = 1);
    start(false);
    BREAKS("turned off under the system clock", RCC_CR &= ~RCC_CR_PLLON);
    BREAKS("PLLCFGR written while the PLL is on", RCC_PLLCFGR = 0);
    BREAKS("APB1 above 42 MHz", RCC_CFGR = RCC_CFGR_SW_PLL);
    BREAKS("flash's wait states", FLASH_ACR = 0, RCC_CFGR = RCC_CFGR_SW_PLL | RCC_CFGR_APB1_BY_4);
    chip_reset(false);
    BREAKS("without its clock", SPI2_CR1 = 0);
    BREAKS("before its clock is stable", RCC_APB1ENR |= RCC_APB1ENR_SPI2, SPI2_CR1 = 0);
    start(false);
    BREAKS("", SPI2_CR1 = SPI_CR1_MSTR, SPI2_CR1 = SPI_CR1_MSTR | SPI_CR1_SPE);
    BREAKS("format changed while enabled", SPI2_CR1 |= SPI_CR1_BR(3));
    BREAKS("SCK without a pull-down", GPIO_PUPDR(PORT_SPI) &= 2u << 2 * PIN_MISO, SPI2_CR1 |= SPI_CR1_SPE);
    BREAKS("MISO floats", GPIO_PUPDR(PORT_SPI) = 0, SPI2_CR1 |= SPI_CR1_SPE);
    BREAKS("SCK is slow", GPIO_OSPEEDR(PORT_SPI) = 1u << 2 * PIN_SCK, SPI2_CR1 |= SPI_CR1_SPE);
    BREAKS("FLASH_CR written while locked", FLASH_CR = FLASH_CR_PG);
    BREAKS("flash written while locked", REG32(0x08004000u) = 0);
    BREAKS("not as one by 32 bits", FLASH_KEYR = FLASH_KEY_1, FLASH_KEYR = FLASH_KEY_2,
           FLASH_CR = FLASH_CR_SER | FLASH_CR_STRT);
    BREAKS("DBG_SLEEP", REG32(0xE0042004u) = 1);
    BREAKS("less than one", USART3_BRR = 12);
    BREAKS("while unlocked", FLASH_KEYR = FLASH_KEY_1);
    BREAKS("fed late", now_ns += 900000000, watchdog_feed()); // after an erase that took half a second
    BREAKS("RLR written while locked", IWDG_RLR = 1);
    BREAKS("halt by a debugger", DBGMCU_APB1_FZ = 0, IWDG_KR = IWDG_KR_START);
}
