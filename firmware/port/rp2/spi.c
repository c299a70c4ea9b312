// The sensors' bus: SPI0, 16-bit frames, mode 0, with the chip selects as plain outputs.
#include "only_board.h"

#include "pins.h"
#include "selects.h"
#include "system.h"
#include "wait.h"
#include "wire/sensor_gen.h"

// SCK = clk_peri / (CPSDVSR * (1 + SCR)) = 125 MHz / 28 = 4.46 MHz: the nearest to BT_SPI_HZ there is, and
// far from the sensor's 10 MHz.
#define CLK_PERI_HZ CLK_SYS_HZ
#define CPSDVSR     2u
#define SCR         13u
_Static_assert(CLK_PERI_HZ / (CPSDVSR * (1 + SCR)) < BT_SPI_HZ + BT_SPI_HZ / 50
                   && CLK_PERI_HZ / (CPSDVSR * (1 + SCR)) > BT_SPI_HZ - BT_SPI_HZ / 50,
               "SCK within 2 % of the bus rate");

#define SELECT(n)   (1u << PIN_SELECT_##n)
#define ALL_SELECTS (SELECT(0) | SELECT(1) | SELECT(2) | SELECT(3) | SELECT(4))

static void output(uint32_t pin, uint32_t function)
{
    PADS_BANK0_GPIO(pin) = PADS_DRIVE_4MA | PADS_SCHMITT | PADS_IE;
    IO_BANK0_GPIO_CTRL(pin) = function;
}

// The sensors allow 10 MHz. The core clocks slower rates, for long leads: slot.c has fixed times for a slot's
// words. At 1 MHz five fingers fill a slot.
#define SCR_LEAST 6u
#define SCR_MOST  62u
uint32_t spi_control = SSPCR0_DSS_16 | SCR << SSPCR0_SCR_LSB;

#define MOST_KHZ (CLK_PERI_HZ / 1000 / CPSDVSR) // with SCR 0

void port_spi_rate(bt_port *port, uint32_t khz)
{
    uint32_t scr = khz == 0 ? SCR : (MOST_KHZ - 1) / khz; // the divider's next whole number, less 1
    scr = scr > SCR_MOST ? SCR_MOST : scr < SCR_LEAST ? SCR_LEAST : scr;
    spi_control = SSPCR0_DSS_16 | scr << SSPCR0_SCR_LSB;
}

uint32_t spi_khz(void)
{
    return MOST_KHZ / ((spi_control >> SSPCR0_SCR_LSB) + 1);
}

bool spi_is_slow(void)
{
    return spi_control >> SSPCR0_SCR_LSB > SCR;
}

// Rate and width change while the block is off (PL022 manual, 3.3.1), idle after the last word; the clock
// stays low.
void spi_configure(uint32_t control)
{
    if (SPI0_SSPCR0 != control) {
        SPI0_SSPCR1 = 0;
        SPI0_SSPCPSR = CPSDVSR;
        SPI0_SSPCR0 = control;
        SPI0_SSPCR1 = SSPCR1_SSE;
    }
}

void spi_reset(void)
{
    (void)reset_blocks(RESETS_SPI0);
    spi_configure(spi_control);
}

void spi_start(void)
{
#ifdef PIN_SMPS_PWM
    SIO_GPIO_OUT_SET = 1u << PIN_SMPS_PWM; // the sensors' supply: less than 20 mV of ripple
    SIO_GPIO_OE_SET = 1u << PIN_SMPS_PWM;
    output(PIN_SMPS_PWM, GPIO_FUNC_SIO);
#endif
    // High before they become outputs: no sensor may see a select on the way up.
    SIO_GPIO_OUT_SET = ALL_SELECTS;
    SIO_GPIO_OE_SET = ALL_SELECTS;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        output(select_pin[f], GPIO_FUNC_SIO);
    }
    spi_configure(spi_control);
    output(PIN_SCK, GPIO_FUNC_SPI);
    output(PIN_MOSI, GPIO_FUNC_SPI);
    // Pulled down: a line without a sensor reads 0x0000, which the driver treats as absent.
    PADS_BANK0_GPIO(PIN_MISO) = PADS_IE | PADS_SCHMITT | PADS_PDE;
    IO_BANK0_GPIO_CTRL(PIN_MISO) = GPIO_FUNC_SPI;
}

void spi_select_at_once(uint8_t mask)
{
    uint32_t low = 0;
#pragma GCC unroll 5 // no loop: runs in every slot
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        low |= (uint32_t)(mask >> f & 1) << select_pin[f];
    }
    SIO_GPIO_OUT_SET = ALL_SELECTS & ~low;
    SIO_GPIO_OUT_CLR = low;
}

void port_spi_select(bt_port *port, uint8_t mask)
{
    wait_short_ns(SELECT_HOLD_NS); // for the selected sensor; the last word is out
    spi_select_at_once(mask);
    if (mask != 0) {
        wait_short_ns(SELECT_SETUP_NS);
    }
}

static void begin(uint32_t mosi)
{
    if (wait_for(&SPI0_SSPSR, SSPSR_BSY, 0, WAIT_SPI_TURNS)) {
        drain(&SPI0_SSPSR, SSPSR_RNE, &SPI0_SSPDR, SPI_FIFO_WORDS);
        SPI0_SSPDR = mosi;
    }
}

// Returns 0, which reads as an absent sensor, for a late word. A late word may still come: left in place, it
// would shift every later word to another finger.
static uint32_t end(void)
{
    // Not busy is later than received: the clock has gone low by then, and the select may rise.
    bool done = wait_for(&SPI0_SSPSR, SSPSR_RNE | SSPSR_BSY, SSPSR_RNE, WAIT_SPI_TURNS);
    return done ? SPI0_SSPDR : 0;
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    spi_configure(spi_control);
    begin(mosi);
    return (uint16_t)end();
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    spi_configure(spi_control ^ SSPCR0_DSS_16 ^ SSPCR0_DSS_8);
    begin(mosi);
    return (uint8_t)end();
}
