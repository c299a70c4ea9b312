// What the RP2040's data sheet (sections), its errata and those who found out ask of whoever writes the
// registers.
#include "rp2040_rules.h"

#include "registers.h"

#include <string.h>

#define RESETS     0x4000C000u
#define CLK_REF    0x40008030u
#define CLK_SYS    0x4000803Cu
#define XOSC       0x40024000u
#define PLL_SYS    0x40028000u
#define SPI0       0x4003C000u
#define PADS       0x4001C004u
#define TIMER      0x40054000u
#define WATCHDOG   0x40058000u
#define SIO        0xD0000000u
#define XOSC_LEAST (6u * 12000u / 256u) // of STARTUP, for 6 ms

static const struct {
    uint32_t at, bytes, bit;
} block[] = {
    {0x40000000u, 0x4000, 19}, {0x40014000u, 0x4000, 5},   {0x4001C000u, 0x4000, 8},
    {PLL_SYS, 0x4000, 12},     {0x4002C000u, 0x4000, 13},  {0x40034000u, 0x4000, 22},
    {SPI0, 0x4000, 16},        {0x4004C000u, 0x4000, 0},   {TIMER, 0x4000, 21},
    {0x50000000u, 0x1000, 2},  {0x50100000u, 0x20000, 24},
};

uint32_t gpio_in, gpio_out, usb_resets;
static uint32_t outputs, pads_set; // bit masks of pins
static uint64_t fed_ns;

void chip_reset(void)
{
    static bool mapped;
    if (!mapped) {
        registers_map(0x40000000u, 0x70000);
        registers_map(0x50000000u, 0x1000);
        registers_map(0x50100000u, 0x20000);
        registers_map(SIO, 0x1000);
        registers_map(0xE000E000u, 0x1000);
        mapped = true;
    }
    memset((void *)0x40000000u, 0, 0x70000);
    memset((void *)0x50000000u, 0, 0x1000);
    memset((void *)0x50100000u, 0, 0x20000);
    poke(RESETS, 0x01FFFFFFu & ~(1u << 6 | 1u << 9 | 1u << 21)); // IO_QSPI, PADS_QSPI, TIMER: its ROM's doing
    poke(TIMER + 0x2C, 7);
    poke(PLL_SYS + 4, 0x2D);
    poke(PLL_SYS + 0x4004, 0x2D);
    for (uint32_t pin = 0; pin < 30; pin++) {
        poke(PADS + 4 * pin, 0x56);
        poke(0x40014004u + 8 * pin, 31);
    }
    gpio_in = gpio_out = usb_resets = outputs = pads_set = 0;
    fed_ns = now_ns;
    broken[0] = '\0';
}

static void touch(uint32_t at)
{
    if (now_ns - fed_ns > 2000000000u) {
        break_rule("watchdog fed late: boot2 sets it to two seconds");
    }
    for (unsigned k = 0; k < sizeof block / sizeof *block; k++) {
        if (at - block[k].at < block[k].bytes && peek(RESETS) >> block[k].bit & 1) {
            break_rule("a block touched while in reset (2.14)");
        }
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
    } else if (at == PLL_SYS || at == PLL_SYS + 0x4000) {
        poke(at, (peek(at) & ~(1u << 31)) | locked(at));
    } else if (at == TIMER + 0x28) {
        poke(at, (uint32_t)(now_ns / 1000));
    } else if (at == SPI0 + 8) {
        poke(SPI0 + 12, 0);
    } else if (at == 0x4004C000u) {
        poke(at, peek(at) | 1u << 8);
    } else if (at == SIO + 4) {
        for (uint32_t pin = 0; pin < 30; pin++) {
            const uint32_t pad = peek(PADS + 4 * pin), input = pads_set & ~outputs & ~(pad >> 7 << pin);
            if (input >> pin & 1 && pad & 1u << 6 && !(pad & 12)
                && (peek(0x40014004u + 8 * pin) & 31) % 26 == 5) {
                break_rule("an input read without a pull: where nothing drives it, it floats (2.19.4)");
            } else if (input >> pin & 1 && !(pad & 1u << 6)) {
                break_rule("a pin read without its pad's input enable (2.19.4)");
            }
        }
        poke(at, gpio_in);
    }
}

static void clocks(uint32_t at, uint32_t value)
{
    if (at == XOSC && value >> 12 == 0xFAB && peek(XOSC + 12) < XOSC_LEAST) {
        break_rule(
            "the crystal is given less than 6 ms (pico-sdk #2234: a Pico's takes that long from cold)");
    } else if (at == CLK_SYS && value & 1 && !locked(PLL_SYS)) {
        break_rule("clk_sys switched to a PLL that is not locked (2.18)");
    } else if ((at == PLL_SYS + 8 || at == PLL_SYS + 0x4008) && (value < 63 || value > 133)) {
        break_rule("a PLL's oscillator outside of 750 to 1600 MHz (2.18.2)");
    } else if (at == PLL_SYS + 8 && peek(CLK_SYS) & 1) {
        break_rule("the PLL changed under clk_sys (2.18)");
    }
}

static void rest(uint32_t at, uint32_t old, uint32_t value)
{
    usb_resets += at == RESETS && ~old & value & 1u << 24;
    if (at == SPI0 && value != old && peek(SPI0 + 4) & 2) {
        break_rule("SPI's frame format changed while enabled (PL022 3.3.1; pico-sdk, spi_set_baudrate)");
    } else if (at == SPI0 + 0x10 && (value & 1 || value == 0)) {
        break_rule("an odd SSPCPSR (4.4.4)");
    } else if (at == SPI0 + 8) {
        poke(SPI0 + 12, 4);
    } else if (at == TIMER + 0x10 && peek(TIMER + 0x2C) != 0) {
        break_rule(
            "an alarm of a timer that a debugger's halt of the other core stops (DBGPAUSE; pico-sdk #1152)");
    } else if (at - PADS < 4 * 30) {
        pads_set |= 1u << (at - PADS) / 4;
    } else if (at == WATCHDOG + 4) {
        if (value > 0xFFFFFFu) {
            break_rule("a watchdog's LOAD of more than 24 bits (4.7)");
        }
        fed_ns = now_ns;
    } else if (at == SIO + 0x14) {
        gpio_out |= value;
    } else if (at == SIO + 0x18) {
        gpio_out &= ~value;
    } else if (at == SIO + 0x24) {
        outputs |= value;
    }
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
