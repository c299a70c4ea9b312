// Rules for writing the registers of an RP2040 or an RP2350, by the data sheets (sections are the RP2040's),
// the errata and reports. CHIP_facts.h comes before all else; CHIP_rules.c has the rules of one chip alone.
#include "rp2_rules.h"
#include "rp2_own.h"

#include "registers.h"

#include <string.h>

#define CLK_REF      (CLOCKS + 0x30u)
#define CLK_SYS      (CLOCKS + 0x3Cu)
#define SIO          0xD0000000u
#define DMA          0x50000000u
#define XOSC_LEAST   (6u * 12000u / 256u) // of STARTUP, for 6 ms
#define TREQ_TIMER0  0x3Bu
#define TREQ_UNPACED 0x3Fu

static const struct {
    uint32_t at, bytes, bit;
} block[] = {RESET_BITS};

uint32_t gpio_in, gpio_out, usb_resets;
bool dma_is_late;
uint32_t heard[64], words_heard, sck_khz, word_bits;
static uint32_t outputs, sio_out, pads_set; // bit masks of pins
static uint64_t fed_ns;

void chip_reset(void)
{
    static bool mapped;
    if (!mapped) {
        registers_map(0x40000000u, APB_BYTES);
        registers_map(DMA, 0x4000);
        registers_map(0x50100000u, 0x20000);
        registers_map(SIO, 0x1000);
        registers_map(0xE000E000u, 0x1000);
        mapped = true;
    }
    memset((void *)0x40000000u, 0, APB_BYTES);
    memset((void *)DMA, 0, 0x4000);
    memset((void *)0x50100000u, 0, 0x20000);
    poke(RESETS, RESETS_LEFT);
    poke(TIMER + 0x2C, 7);
    poke(PLL_SYS + 4, 0x2D);
    poke(PLL_USB + 4, 0x2D);
    for (uint32_t pin = 0; pin < 30; pin++) {
        poke(PADS + 4 * pin, PAD_RESET);
        poke(IO + 4 + 8 * pin, 31);
    }
    gpio_in = gpio_out = usb_resets = outputs = sio_out = pads_set = words_heard = 0;
    dma_is_late = false;
    fed_ns = now_ns;
    own_reset();
    broken[0] = '\0';
}

static void touch(uint32_t at)
{
    bool known = at >= 0x50000000u || (at >= RESETS && at < RESETS + 0x4000) || own_knows(at)
                 || (at >= CLOCKS && at < CLOCKS + 0x4000) || (at >= XOSC && at < XOSC + 0x4000)
                 || (at >= WATCHDOG && at < WATCHDOG + 0x4000);
    if (now_ns - fed_ns > 2000000000u) {
        break_rule("watchdog fed late: boot2 sets it to two seconds");
    }
    for (unsigned k = 0; k < sizeof block / sizeof *block; k++) {
        if (at - block[k].at < block[k].bytes && peek(RESETS) >> block[k].bit & 1) {
            break_rule("a block touched while in reset (2.14)");
        }
        known = known || at - block[k].at < block[k].bytes;
    }
    if (!known) {
        break_rule("an address where this chip has nothing of ours (2.2)");
    }
}

// Of a pin that SIO drives: 1 for high, 0 for low, -1 for neither. An isolated pad keeps the level
// (RP2350, 9.7).
static int driven(uint32_t pin)
{
    const uint32_t ctrl = peek(IO + 4 + 8 * pin), pad = peek(PADS + 4 * pin), over = ctrl >> OUTOVER_LSB & 3;
    if ((ctrl & 31) != 5 || !(outputs >> pin & 1) || pad & (PAD_ISO | 1u << 7)) {
        return -1;
    }
    return over >= 2 ? over == 3 : (int)((sio_out >> pin & 1) ^ over);
}

static uint32_t pins_that_are(int level)
{
    uint32_t pins = 0;
    for (uint32_t pin = 0; pin < 30; pin++) {
        pins |= (uint32_t)(driven(pin) == level) << pin;
    }
    return pins;
}

// A PLL's output, by the registers; 0 while a part of it is off.
static uint32_t pll_mhz(uint32_t pll)
{
    const uint32_t by = (peek(pll + 12) >> 16 & 7) * (peek(pll + 12) >> 12 & 7);
    return peek(pll + 4) & 0x29 || by == 0 ? 0 : 12 * peek(pll + 8) / by;
}

uint32_t uart_bits_per_s(void)
{
    bool own = (peek(UART + 0x30) & 0x301) == 0x301 && peek(UART + 0x2C) & 1u << 4;
    for (uint32_t pin = 0; pin < 2; pin++) {
        own = own && (peek(IO + 4 + 8 * pin) & 31) == 2 && !(peek(PADS + 4 * pin) & (PAD_ISO | 1u << 7));
    }
    return own ? 125000000u / 16 * 64 / (peek(UART + 0x24) * 64 + peek(UART + 0x28)) : 0;
}

void interrupt_used(int number)
{
    if (!(INTERRUPTS >> number & 1)) {
        break_rule("an interrupt of a block that is none of ours (2.3.2)");
    }
}

static void spi_word(void)
{
    sck_khz = 125000u / (peek(SPI0 + 0x10) * ((peek(SPI0) >> 8) + 1));
    word_bits = (peek(SPI0) & 15) + 1;
    if ((peek(PADS + 4 * 16) & 0xCC) != 0x44) {
        break_rule("a word on the bus without MISO's pull-down: an absent sensor reads as anything");
    }
    if (words_heard < 64) {
        heard[words_heard++] = pins_that_are(0);
    }
    for (uint32_t pin = 16; pin < 20; pin++) {
        if (pin != 17 && ((peek(IO + 4 + 8 * pin) & 31) != 1 || peek(PADS + 4 * pin) & PAD_ISO)) {
            break_rule("a word on the bus whose pins are not SPI's, or isolated");
        }
    }
    poke(SPI0 + 12, 4);
}

static uint32_t field(uint32_t channel, uint32_t lsb, uint32_t bits)
{
    return peek(DMA + 0x40 * channel + 0x0C) >> lsb & ((1u << bits) - 1);
}

// A slot's control blocks (2.5.6.2), done at once: the dealer, channel 0, deals pairs of addresses to the
// worker's.
static void deal(void)
{
    const uint32_t steps = peek(DMA + 8) / 2, *step = (const uint32_t *)(uintptr_t)peek(DMA);
    if (field(0, TREQ_LSB, 6) != TREQ_TIMER0 || field(0, CHAIN_LSB, 4) != 0 || !field(0, QUIET_LSB, 1)
        || field(0, RING_LSB, 5) != 0x13 || !field(0, INCR_WRITE_LSB, 1) || field(0, 2, 3) != 6
        || field(1, TREQ_LSB, 6) != TREQ_UNPACED || field(1, CHAIN_LSB, 4) != 1 || field(1, 2, 3) != 2) {
        break_rule("the DMA's channels are not set up for control blocks");
    } else if (!field(1, 0, 1)) {
        break_rule("a slot begun while the worker is off");
    } else {
        for (uint32_t k = 0; k < steps && !dma_is_late; k++, step += 2) {
            if (step[1] == SPI0 + 8) {
                spi_word();
            } else if (step[1] != 0) {
                poke(step[1], peek(step[0]));
            }
        }
    }
    poke(SPI0 + 12, 0);
}

// Both names of a channel's CTRL are one register; an abort of a channel that is on may start it again
// (RP2350-E5).
static void dma(uint32_t at, uint32_t value)
{
    const uint32_t channel = (at - DMA) / 0x40;
    if (channel < 12 && ((at & 0x3F) == 0x0C || (at & 0x3F) == 0x10)) {
        poke(DMA + 0x40 * channel + 0x0C, value);
        poke(DMA + 0x40 * channel + 0x10, value);
        if (channel == 0 && (at & 0x3F) == 0x0C && value & 1) {
            deal();
        }
    } else if (at == ABORT) {
        if ((value & 1 && field(0, 0, 1)) || (value & 2 && field(1, 0, 1))) {
            break_rule("a DMA channel aborted while it is on (RP2350-E5)");
        }
        dma_is_late = false;
        poke(ABORT, 0);
    } else if (at == ABORT - 0x24 && value != (1u << 16 | 125)) {
        break_rule("the DMA's timer does not tick once a us (2.5.3.2)");
    } else if (at >= DMA + 0x400 && at < DMA + 0x800 && at != ABORT - 0x24) {
        break_rule("a DMA register that is none of ours");
    }
}

static uint32_t locked(uint32_t pll)
{
    return peek(pll + 4) & 0x21 || peek(pll + 8) == 0 ? 0 : 1u << 31;
}

void on_read(uint32_t at)
{
    touch(at);
    if (at == RESETS + 8) {
        poke(at, ~peek(RESETS));
    } else if (at == CLK_REF + 8) {
        poke(at, 1u << (peek(CLK_REF) & 3));
    } else if (at == CLK_SYS + 8) {
        poke(at, 1u << (peek(CLK_SYS) & 1));
    } else if (at == XOSC + 4) {
        poke(at, peek(XOSC) >> 12 == 0xFAB ? 1u << 31 : 0);
    } else if (at == PLL_SYS || at == PLL_USB) {
        poke(at, (peek(at) & ~(1u << 31)) | locked(at));
    } else if (at == TIMER + 0x28) {
        poke(at, (uint32_t)(now_ns / 1000));
    } else if (at == SPI0 + 8) {
        poke(SPI0 + 12, 0);
    } else if (at - DMA < 0x40 * 12 && (at & 0x3F) == 0x0C) {
        poke(at, (peek(at) & ~(1u << BUSY_LSB)) | (uint32_t)(dma_is_late && at == DMA + 0x0C) << BUSY_LSB);
    } else if (at == ADC) {
        poke(at, peek(at) | 1u << 8);
    } else if (at == ADC + 4) { // 27 degrees, and a third of 4.75 V
        const uint32_t input = peek(ADC) >> 12 & 7;
        poke(at, input == 4 && (peek(ADC) & 3) == 3 ? 876 : input == 3 && peek(ADC) & 1 ? 1965 : 0);
    } else if (at == SIO + 4) {
        for (uint32_t pin = 0; pin < 30; pin++) {
            const uint32_t pad = peek(PADS + 4 * pin), input = pads_set & ~outputs & ~(pad >> 7 << pin);
            if (input >> pin & 1 && pad & 1u << 6 && !(pad & 12) && (peek(IO + 4 + 8 * pin) & 31) % 26 == 5) {
                break_rule("an input read without a pull: where nothing drives it, it floats (2.19.4)");
            } else if (input >> pin & 1 && !(pad & 1u << 6)) {
                break_rule("a pin read without its pad's input enable (2.19.4)");
            }
        }
        poke(at, gpio_in);
    }
    own_read(at);
}

static void clocks(uint32_t at, uint32_t value)
{
    if (at == XOSC && value >> 12 == 0xFAB && peek(XOSC + 12) < XOSC_LEAST) {
        break_rule(
            "the crystal is given less than 6 ms (pico-sdk #2234: a Pico's takes that long from cold)");
    } else if (at == CLK_SYS && value & 1 && !locked(PLL_SYS)) {
        break_rule("clk_sys switched to a PLL that is not locked (2.18)");
    } else if (at == CLK_SYS && value & 1 && pll_mhz(PLL_SYS) != 125) {
        break_rule("clk_sys is not the 125 MHz that the port counts by (2.18)");
    } else if (at == 0x5011004Cu && value & 1u << 16 && pll_mhz(PLL_USB) != 48) {
        break_rule("clk_usb is not 48 MHz (2.15.1)");
    } else if ((at == PLL_SYS + 8 || at == PLL_USB + 8) && (value < 63 || value > 133)) {
        break_rule("a PLL's oscillator outside of 750 to 1600 MHz (2.18.2)");
    } else if (at == PLL_SYS + 8 && peek(CLK_SYS) & 1) {
        break_rule("the PLL changed under clk_sys (2.18)");
    }
}

static void rest(uint32_t at, uint32_t old, uint32_t value)
{
    usb_resets += at == RESETS && ~old & value & 1u << USBCTRL_RESET;
    if (at == SPI0 && value != old && peek(SPI0 + 4) & 2) {
        break_rule("SPI's frame format changed while enabled (PL022 3.3.1; pico-sdk, spi_set_baudrate)");
    } else if (at == SPI0 + 0x10 && (value & 1 || value == 0)) {
        break_rule("an odd SSPCPSR (4.4.4)");
    } else if (at == SPI0 + 8) {
        spi_word();
    } else if (at == TIMER + 0x10 && peek(TIMER + 0x2C) != 0) {
        break_rule(
            "an alarm of a timer that a debugger's halt of the other core stops (DBGPAUSE; pico-sdk #1152)");
    } else if (at - PADS < 4 * 30) {
        pads_set |= 1u << (at - PADS) / 4;
    } else if (at == WATCHDOG + 4) {
        if (value > 0xFFFFFFu) {
            break_rule("a watchdog's LOAD of more than 24 bits (4.7)");
        } else if (value != 2000000u * LOADS_OF_A_US) {
            break_rule("a watchdog's LOAD that is not two seconds (4.7, RP2040-E1)");
        }
        fed_ns = now_ns;
    } else if (at == SIO + OUT_SET) {
        sio_out |= value;
    } else if (at == SIO + OUT_CLR) {
        sio_out &= ~value;
    } else if (at == SIO + OE_SET) {
        outputs |= value;
    } else if (at >= SIO && at < SIO + 0x1000) {
        break_rule("a SIO register that is none of ours");
    } else if (at >= DMA && at < DMA + 0x1000) {
        dma(at, value);
    }
    gpio_out = pins_that_are(1);
    own_write(at, old, value);
}

void on_write(uint32_t at, uint32_t old, uint32_t value)
{
    const uint32_t alias = at < SIO && (at < 0x50100000u || at >= 0x50110000u) ? at >> 12 & 3 : 0;
    const uint32_t base = at - alias * 0x1000;
    touch(base);
    if (alias != 0) { // 2.1.2
        const uint32_t before = peek(base);
        poke(at, old);
        value = alias == 2 ? before | value : alias == 3 ? before & ~value : before ^ value;
        old = before;
        poke(base, value);
    }
    clocks(base, value);
    rest(base, old, value);
}

void on_asm(const char *text)
{
    (void)text;
}
