// What the RP2350 alone asks, by its data sheet (sections are its own) and errata: rp2_rules.c has the rest.
// It starts as the ROM of the steppings A3 and A4 leaves it, every divider other than 1.
#include "registers.h"
#include "rp2_own.h"

#define DIVIDERS 5
static const uint32_t divider[DIVIDERS] = {0x34, 0x40, 0x4C, 0x64,
                                           0x70}; // of CLOCKS: REF, SYS, PERI, USB, ADC
enum { REF, SYS, PERI, USB, ADC_CLOCK };

#define USB_MAIN    0x50110040u
#define USB_SIE     0x5011004Cu
#define QMI_IN_CHIP 16               // bytes of a command and its answer that the flash knows
static uint32_t in_command, to_come; // of QMI: the byte that comes next, and how many wait
static uint8_t command;

void own_reset(void)
{
    for (int k = 0; k < DIVIDERS; k++) {
        poke(CLOCKS + divider[k], 5u << 16);
    }
    poke(CLOCKS + 0x3C, 0x41); // clk_sys from the ring oscillator
    poke(USB_MAIN, 1u << 2);
    poke(USB_SIE, 1u << 15);
    poke(QMI, 1u << 16);
    in_command = to_come = 0;
}

bool own_knows(uint32_t at)
{
    return (at >= PSM && at < PSM + 0x4000) || (at >= QMI && at < QMI + 0x4000)
           || (at >= TICKS && at < TICKS + 0x4000) || (at >= ROSC && at < ROSC + 0x4000);
}

static bool divided(int clock)
{
    return peek(CLOCKS + divider[clock]) != 1u << 16;
}

static bool ticks(uint32_t at)
{
    return peek(TICKS + at) & 1 && peek(TICKS + at + 4) == 12;
}

void own_read(uint32_t at)
{
    if (at == TIMER + 0x28 && (!ticks(0x18) || divided(REF))) {
        break_rule("the timer read without a tick every us (8.5)");
        poke(at, 0);
    } else if (at == ADC && divided(ADC_CLOCK)) {
        break_rule("a divider left as the ROM had it (8.1; appendix C)");
    } else if (at == QMI) {
        poke(at, (peek(at) & ~(1u << 16)) | (uint32_t)(to_come == 0) << 16);
    } else if (at == QMI + 8 && to_come > 0) {
        static const uint8_t jedec[] = {0, 0xEF, 0x40, 0x16};
        const uint32_t k = in_command - to_come--;
        poke(at, command == 0x9F && k < 4 ? jedec[k] : command == 0x4B && k >= 5 ? 0x20 + k : 0);
    }
}

static void flash_bus(uint32_t at, uint32_t value)
{
    if (at == QMI && !(value & 1u << 2)) {
        in_command = to_come = 0; // the select is high: the next byte is a command
    } else if (at == QMI + 4) {
        if ((peek(QMI) & 5) != 5) {
            break_rule("a byte to the flash without direct mode and its select (12.14.5)");
        }
        command = in_command++ == 0 ? (uint8_t)value : command;
        to_come++;
    }
}

void own_write(uint32_t at, uint32_t old, uint32_t value)
{
    if (at == CLOCKS + 0x3C && value & 1 && value != old && (divided(REF) || divided(SYS))) {
        break_rule("a divider left as the ROM had it (8.1; appendix C)");
    } else if ((at == SPI0 + 8 || (at == UART + 0x30 && value & 1)) && divided(PERI)) {
        break_rule("a divider left as the ROM had it (8.1; appendix C)");
    } else if (at == USB_MAIN && value & 1 && (divided(USB) || value & 1u << 2)) {
        break_rule("the USB's PHY isolated (12.7.2), or its clock divided (8.1)");
    } else if (at == USB_SIE && value & 1u << 16 && value & 1u << 15) {
        break_rule("D+ pulled up and down (12.7.2)");
    } else if (at == USB_SIE && value & 1u << 16 && (peek(USB_MAIN) & 5) != 1) {
        break_rule("D+ pulled up before the controller is on and its PHY joined (12.7.2)");
    } else if (at == XOSC
               && (!(peek(WATCHDOG) & 1u << 30) || (peek(PSM + 8) & 0x01FFFFFF) != 0x01FFFFF3
                   || !ticks(0x30))) {
        break_rule("the crystal started without a watchdog that resets all but the oscillators (12.9, 7.4)");
    } else if (at == WATCHDOG && value & 1u << 30 && !(value >> 24 & 7)) {
        break_rule("a watchdog that a debugger's halt does not stop (12.9)");
    } else if (at >= QMI && at < QMI + 0x10) {
        flash_bus(at, value);
    }
}
