// Rules of the RP2350 alone, by the data sheet (sections are this chip's) and errata: rp2_rules.c has the
// rest. It starts as the ROM of the steppings A3 and A4 leaves it, every divider other than 1.
#include "registers.h"
#include "rp2_own.h"
#include "rp2_rules.h"

#include <string.h>

#define DIVIDERS 5
static const uint32_t divider[DIVIDERS] = {0x34, 0x40, 0x4C, 0x64,
                                           0x70}; // of CLOCKS: REF, SYS, PERI, USB, ADC
enum { REF, SYS, PERI, USB, ADC_CLOCK };

#define USB_MAIN     0x50110040u
#define USB_SIE      0x5011004Cu
#define LOOKS_A_BYTE 8 // of the program while a byte is on the wire
#define QMI_FIFO     4 // bytes on their way at most
// Of QMI: the byte that comes next, how many are under way, and have come.
static uint32_t looks, in_command, sent, come;
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
    in_command = sent = come = 0;
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
        poke(at, (peek(at) & ~(1u << 16 | 1u << 10)) | (uint32_t)(come == 0) << 16
                     | (uint32_t)(sent == QMI_FIFO) << 10);
        if (sent > 0 && ++looks % LOOKS_A_BYTE == 0) {
            come++;
            sent--;
        }
    } else if (at == QMI + 8 && come == 0) {
        break_rule("an answer of the flash taken that has not come (12.14.5)");
    } else if (at == QMI + 8) {
        static const uint8_t jedec[] = {0, 0xEF, 0x40, 0x16};
        const uint32_t k = in_command - sent - come--;
        poke(at, command == 0x9F && k < 4 ? jedec[k] : command == 0x4B && k >= 5 ? 0x20 + k : 0);
    }
}

static void flash_bus(uint32_t at, uint32_t value)
{
    if (at == QMI && !(value & 1u << 2)) {
        in_command = sent = come = 0; // the select is high: the next byte is a command
    } else if (at == QMI + 4) {
        if ((peek(QMI) & 5) != 5) {
            break_rule("a byte to the flash without direct mode and its select (12.14.5)");
        }
        if (sent == QMI_FIFO) {
            break_rule("a byte to the flash that has no room (12.14.5)");
        }
        command = in_command++ == 0 ? (uint8_t)value : command;
        sent += sent < QMI_FIFO;
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

// ---- the ROM's functions (5.4), each noted by a letter

#define KEPT_FROM  (4u * 1024 * 1024 - 228 * 1024) // of the flash: maps and settings, to the end
#define ARM_SECURE 4
#define TO_BOOTSEL 2u
#define NO_RETURN  0x100u
char rom_calls[64];

static void called(char letter)
{
    const size_t used = strlen(rom_calls);
    registers_settle();
    if (used + 1 < sizeof rom_calls) {
        rom_calls[used] = letter;
        rom_calls[used + 1] = '\0';
    }
    if (peek(QMI) & 1) {
        break_rule("a ROM function called in direct mode, which its own code turns over (12.14.5)");
    }
}

#define CALL(letter)                                                                                         \
    static void call_##letter(void)                                                                          \
    {                                                                                                        \
        called(#letter[0]);                                                                                  \
    }
CALL(I)
CALL(E)
CALL(F)
CALL(C)

static void change(char letter, uint32_t offset, bool right)
{
    called(letter);
    if (!right || offset < KEPT_FROM || offset >= 4u * 1024 * 1024 || strlen(rom_calls) < 3
        || memcmp(rom_calls + strlen(rom_calls) - 3, "IE", 2) != 0) {
        break_rule(
            "flash changed beside what is kept, in parts that it has not, or without leaving XIP (5.4.8)");
    }
}

static void erase(uint32_t offset, uint32_t bytes, uint32_t block_bytes, uint32_t block_command)
{
    change('R', offset, offset % 4096 == 0 && bytes == 4096 && block_bytes == 4096 && block_command == 0x20);
}

static void program(uint32_t offset, const uint8_t *data, uint32_t bytes)
{
    change('P', offset, data != NULL && offset % 256 == 0 && bytes == 256);
}

static int reboot(uint32_t flags, uint32_t delay_ms, uint32_t first, uint32_t second)
{
    if (flags != (TO_BOOTSEL | NO_RETURN) || delay_ms == 0 || first != 0 || second != 0) {
        break_rule("a reboot that is not into the loader's drive and PICOBOOT (5.4.8.24)");
    }
    longjmp(registers_left, 2);
}

static void *lookup(uint32_t code, uint32_t mask)
{
    static const struct {
        char name[3];
        void (*function)(void);
    } known[] = {{"IF", call_I},
                 {"EX", call_E},
                 {"FC", call_F},
                 {"CX", call_C},
                 {"RE", (void (*)(void))erase},
                 {"RP", (void (*)(void))program},
                 {"RB", (void (*)(void))reboot}};
    for (unsigned k = 0; mask == ARM_SECURE && k < sizeof known / sizeof *known; k++) {
        if (code == ((uint32_t)known[k].name[1] << 8 | (uint32_t)known[k].name[0])) {
            return (void *)(uintptr_t)known[k].function;
        }
    }
    break_rule("a ROM function that there is not for Arm Secure (5.4.1)");
    return NULL;
}

const volatile uintptr_t rom_table_lookup = (uintptr_t)lookup;
