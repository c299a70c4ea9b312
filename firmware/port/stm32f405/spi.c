// The sensors' bus: SPI2, mode 0, chip selects as plain outputs of one port. The core does a slot word by
// word in the alarm's interrupt, 75 of a slot's 227 us with five fingers; the UART interrupts that.
#include "only_board.h"
#include "spi_word_by_word.h"

#include "pins.h"
#include "stm32f405.h"
#include "wire/sensor_gen.h"

#define BY_4   1u // APB1_HZ / 2^(n + 1): 9 MHz; the sensors allow 10
#define BY_8   2u // the usual rate
#define BY_16  3u
#define BY_32  4u // 1.1 MHz; slower ones leave no time for five words in a slot
#define NS(ns) ((uint32_t)(((ns) * (uint64_t)(HCLK_HZ / 1000000u) + 999) / 1000))

static const uint8_t select_pin[BT_MAX_FINGERS] = PIN_SELECTS;

void spi_start(void)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        GPIO_BSRR(PORT_SELECT) = 1u << select_pin[f]; // high before it becomes an output
        pin_output(PORT_SELECT, select_pin[f]);
    }
    pin_function(PORT_SPI, PIN_SCK, SPI_FUNCTION, PULL_DOWN); // it floats while the block is off (28.3.1)
    pin_function(PORT_SPI, PIN_MOSI, SPI_FUNCTION, PULL_NONE);
    // The receiver samples by SCK at the pad: a slow pad makes a word's last bit old (ES0182 2.5.2).
    GPIO_OSPEEDR(PORT_SPI) |= 3u << 2 * PIN_SCK | 3u << 2 * PIN_MOSI;
    // Pulled down: a line without a sensor reads 0x0000, which the driver treats as absent.
    pin_function(PORT_SPI, PIN_MISO, SPI_FUNCTION, PULL_DOWN);
}

static volatile uint32_t divider = BY_8;

void port_spi_rate(bt_port *port, uint32_t khz)
{
    const uint32_t least = khz == 0 ? 8 : (APB1_HZ / 1000 + khz - 1) / khz;
    divider = least <= 4 ? BY_4 : least <= 8 ? BY_8 : least <= 16 ? BY_16 : BY_32;
}

uint32_t spi_khz(void)
{
    return APB1_HZ / 1000 >> (divider + 1);
}

// Rate and width change while the block is off, by a separate write (RM0090 28.5.1); the clock stays low.
static void configure(uint32_t width)
{
    const uint32_t control = SPI_CR1_MSTR | SPI_CR1_BR(divider) | SPI_CR1_SSI | SPI_CR1_SSM | width;
    if (SPI2_CR1 != (control | SPI_CR1_SPE)) {
        SPI2_CR1 &= ~SPI_CR1_SPE;
        SPI2_CR1 = control;
        SPI2_CR1 = control | SPI_CR1_SPE;
    }
}

void port_spi_select(bt_port *port, uint8_t mask)
{
    uint32_t low = 0, all = 0;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        all |= 1u << select_pin[f];
        low |= (uint32_t)(mask >> f & 1) << select_pin[f];
    }
    wait_cycles(NS(SELECT_HOLD_NS));
    GPIO_BSRR(PORT_SELECT) = (all & ~low) | low << 16;
    if (mask != 0) {
        wait_cycles(NS(SELECT_SETUP_NS));
    }
}

// Returns 0, which reads as an absent sensor, for a missing word. A late word of an earlier exchange is
// discarded first: it would pass for another finger's.
static uint32_t exchange(uint32_t mosi)
{
    if (SPI2_SR & SPI_SR_RXNE) {
        (void)SPI2_DR;
    }
    SPI2_DR = mosi;
    return wait_for(&SPI2_SR, SPI_SR_RXNE | SPI_SR_BSY, SPI_SR_RXNE, WAIT_SPI_TURNS) ? SPI2_DR : 0;
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    configure(SPI_CR1_16_BITS);
    return (uint16_t)exchange(mosi);
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    configure(0);
    return (uint8_t)exchange(mosi);
}
