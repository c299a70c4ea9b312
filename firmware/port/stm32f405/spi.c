// The sensors' bus: SPI2, mode 0, chip selects as plain outputs of one port. The core does a slot word by
// word in the alarm's interrupt, 75 of a slot's 227 us with five fingers; the UART interrupts that.
#include "only_board.h"
#include "spi_word_by_word.h"

#include "pins.h"
#include "stm32f405.h"
#include "wire/sensor_gen.h"

#define SPI_BY_8   2u
#define SPI_HZ     (APB1_HZ / 8)
#define SPI_CR1_ON (SPI_CR1_MSTR | SPI_CR1_BR(SPI_BY_8) | SPI_CR1_SSI | SPI_CR1_SSM | SPI_CR1_SPE)
#define NS(ns)     ((uint32_t)(((ns) * (uint64_t)(HCLK_HZ / 1000000u) + 999) / 1000))

static const uint8_t select_pin[BT_MAX_FINGERS] = PIN_SELECTS;

void spi_start(void)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        GPIO_BSRR(PORT_SELECT) = 1u << select_pin[f]; // high before it becomes an output
        pin_output(PORT_SELECT, select_pin[f]);
    }
    pin_function(PORT_SPI, PIN_SCK, SPI_FUNCTION, PULL_NONE);
    pin_function(PORT_SPI, PIN_MOSI, SPI_FUNCTION, PULL_NONE);
    // Where no sensor drives the line, words read 0x0000, which the driver takes for absent.
    pin_function(PORT_SPI, PIN_MISO, SPI_FUNCTION, PULL_DOWN);
    SPI2_CR1 = SPI_CR1_ON | SPI_CR1_16_BITS;
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
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

// 0, which reads as a sensor that is not there, for a word that did not come. One that came late, of an
// earlier exchange, is read away first: it would be taken for another finger's.
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
    return (uint16_t)exchange(mosi);
}

// The width changes while the block is off; the clock stays low.
uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    SPI2_CR1 = SPI_CR1_ON & ~SPI_CR1_SPE;
    SPI2_CR1 = SPI_CR1_ON;
    uint8_t miso = (uint8_t)exchange(mosi);
    SPI2_CR1 = (SPI_CR1_ON & ~SPI_CR1_SPE) | SPI_CR1_16_BITS;
    SPI2_CR1 = SPI_CR1_ON | SPI_CR1_16_BITS;
    return miso;
}
