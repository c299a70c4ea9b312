// Rules for writing the registers, by RM0090, the F405's data sheet and the errata sheet ES0182.
#include "stm32f405_rules.h"
#include "registers.h"

#include <string.h>

#define CRYSTAL_HZ 12000000u
#define HSI_HZ     16000000u
#define CR         0x40023800u
#define PLLCFGR    0x40023804u
#define CFGR       0x40023808u
#define AHB1ENR    0x40023830u
#define AHB2ENR    0x40023834u
#define APB1ENR    0x40023840u
#define APB2ENR    0x40023844u
#define ACR        0x40023C00u
#define KEYR       0x40023C04u
#define FLASH_SR   0x40023C0Cu
#define FLASH_CR   0x40023C10u
#define GPIOB      0x40020400u
#define SPI_CR1    0x40003800u
#define SPI_SR     0x40003808u
#define SPI_DR     0x4000380Cu
#define IWDG       0x40003000u
#define TIM2_CNT   0x40000024u
#define BRR        0x40004808u
#define DBG_CR     0xE0042004u
#define DBG_FZ     0xE0042008u
#define AIRCR      0xE000ED0Cu
#define PLL_ON     (1u << 24)
#define LOCKED     (1u << 31)

// 64 / 47 kHz * 1001, the fastest LSI (data sheet, 5.3.9).
#define IWDG_LEAST_NS 1363000000u
#define ERASE_MOST_NS 500000000u // 16 KiB by 32 bits (data sheet, 5.3.12)

static const struct {
    uint32_t at, bytes, enable, bit;
} block[] = {
    {0x40000000u, 0x400, APB1ENR, 0},  {0x40003800u, 0x400, APB1ENR, 14}, {0x40004800u, 0x400, APB1ENR, 18},
    {0x40007000u, 0x400, APB1ENR, 28}, {0x40013800u, 0x400, APB2ENR, 14}, {0x40020000u, 0x400, AHB1ENR, 0},
    {0x40020400u, 0x400, AHB1ENR, 1},  {0x40020800u, 0x400, AHB1ENR, 2},  {0x50060800u, 0x400, AHB2ENR, 6},
};

static uint64_t enabled_at; // in accesses, the latest enable that nobody has read back; 0: none
static uint32_t enabled_in, enabled_bits;
static bool latency_is_read, iwdg_open, iwdg_runs;
static int keys, busy_reads;
static uint64_t fed_ns;
uint32_t nvic_enabled[4], gpio_c_out;

void chip_reset(bool by_loader)
{
    static bool mapped;
    if (!mapped) {
        registers_map(0x40000000u, 0x30000);
        registers_map(0x50060000u, 0x1000);
        registers_map(0xE000E000u, 0x1000);
        registers_map(0xE0042000u, 0x1000);
        registers_map(0x08000000u, 0x10000);
        registers_map(0x1FFF0000u, 0x10000);
        registers_reset_at = AIRCR;
        mapped = true;
    }
    memset((void *)0x40000000u, 0, 0x30000);
    memset((void *)0xE000E000u, 0, 0x1000);
    memset((void *)0xE0042000u, 0, 0x1000);
    memset((void *)0x08000000u, 0xFF, 0x10000);
    memset(nvic_enabled, 0, sizeof nvic_enabled);
    poke(CR, 0x83);
    poke(PLLCFGR, 0x24003010);
    poke(FLASH_CR, LOCKED);
    // State after the loader, by AN2606's table of the F40x and stm32duino #1653: the PLL and the USB's
    // interrupt on, and the flash unlocked.
    if (by_loader) {
        poke(CR, 0x83 | PLL_ON | PLL_ON << 1);
        poke(PLLCFGR, 16 | 192 << 6 | 3 << 16 | 4u << 24);
        poke(CFGR, 2 | 2 << 2);
        poke(FLASH_CR, 0);
        nvic_enabled[2] = 1u << (67 - 64);
    }
    enabled_at = 0;
    latency_is_read = iwdg_open = iwdg_runs = false;
    keys = busy_reads = 0;
    gpio_c_out = 0;
    broken[0] = '\0';
}

uint32_t hclk_hz(void)
{
    const uint32_t pll = peek(PLLCFGR), source = pll & 1u << 22 ? CRYSTAL_HZ : HSI_HZ;
    const uint32_t clock[4] = {HSI_HZ, CRYSTAL_HZ,
                               source / (pll & 63) * (pll >> 6 & 511) / (2 * ((pll >> 16 & 3) + 1)), 0};
    return clock[peek(CFGR) >> 2 & 3];
}

static void touch(uint32_t at)
{
    if (iwdg_runs && now_ns - fed_ns > IWDG_LEAST_NS) {
        break_rule("watchdog fed late: LSI may be 47 kHz (data sheet, 5.3.9)");
    }
    for (unsigned k = 0; k < sizeof block / sizeof *block; k++) {
        if (at - block[k].at < block[k].bytes) {
            if (!(peek(block[k].enable) >> block[k].bit & 1)) {
                break_rule("a peripheral touched without its clock (RM0090 7.3)");
            } else if (enabled_at != 0 && enabled_in == block[k].enable && enabled_bits >> block[k].bit & 1
                       && accesses - enabled_at < 5) {
                break_rule("a peripheral touched before its clock is stable (ES0182, delay after an RCC "
                           "peripheral clock enabling): read the enable back");
            }
        }
    }
}

void on_read(uint32_t at)
{
    touch(at);
    if (at == enabled_in) {
        enabled_at = 0;
    }
    latency_is_read = latency_is_read || at == ACR;
    if (at == FLASH_SR && busy_reads != 0 && --busy_reads == 0) {
        poke(FLASH_SR, 0);
    } else if (at == TIM2_CNT) {
        poke(at, (uint32_t)(now_ns / 1000));
    } else if (at == SPI_DR) {
        poke(SPI_SR, 2);
    } else if (at == 0x50060804u) {
        poke(at, 1); // a random number is there
    }
}

static void clocks(uint32_t at, uint32_t old, uint32_t value)
{
    if (at == CR) {
        if (old & ~value & PLL_ON && (peek(CFGR) >> 2 & 3) == 2) {
            break_rule("the PLL turned off under the system clock (RM0090 7.3.1)");
            value |= PLL_ON;
        }
        if (~old & value & PLL_ON && peek(PLLCFGR) & 1u << 22 && !(old & 1u << 17)) {
            break_rule("the PLL turned on before its crystal is ready (RM0090 7.2.3)");
        }
        const uint32_t on = value & (1u << 0 | 1u << 16 | PLL_ON);
        poke(CR, (value & ~(on << 1) & ~(1u << 1 | 1u << 17 | PLL_ON << 1)) | on << 1);
    } else if (at == PLLCFGR && peek(CR) & PLL_ON) {
        break_rule("PLLCFGR written while the PLL is on (RM0090 7.3.2)");
        poke(PLLCFGR, old);
    } else if (at == ACR) {
        latency_is_read = false;
    } else if (at == CFGR) {
        const uint32_t from = value & 3, ready = from == 2 ? PLL_ON << 1 : from == 1 ? 1u << 17 : 1u << 1;
        if (!(peek(CR) & ready)) {
            break_rule("the system clock switched to one that is not ready (RM0090 7.2.6)");
        }
        poke(CFGR, (value & ~12u) | from << 2);
        if (hclk_hz() > 120000000 && ((peek(ACR) & 7) < 4 || !latency_is_read)) {
            break_rule("a clock faster than the flash's wait states, or these not read back (RM0090 3.5.1)");
        }
        static const uint8_t shift[8] = {0, 0, 0, 0, 1, 2, 3, 4};
        if (hclk_hz() >> shift[value >> 10 & 7] > 42000000) {
            break_rule("APB1 above 42 MHz (data sheet, 5.3.1)");
        }
    }
}

static void spi(uint32_t at, uint32_t old, uint32_t value)
{
    const uint32_t format = 0x8BF, enable = 1u << 6; // DFF, LSBFIRST, BR, MSTR, CPOL, CPHA
    if (at == SPI_CR1 && (old | value) & enable && (old ^ value) & format & ~(old & value & 4)) {
        if (old & enable || (old ^ value) & 1u << 11) {
            break_rule("SPI's frame format changed while enabled (RM0090 28.5.1, DFF, BR)");
        }
    }
    if (at == SPI_CR1 && value & enable && value & 4) {
        if ((peek(GPIOB + 8) >> 26 & 3) != 3) {
            break_rule("SPI master receives and SCK is slow (ES0182, corrupted last bit, with delayed SCK "
                       "feedback)");
        } else if ((peek(GPIOB + 12) >> 28 & 3) == 0) {
            break_rule("an input read without a pull: where no sensor is, MISO floats");
        } else if ((peek(GPIOB + 12) >> 26 & 3) != 2) {
            break_rule("SCK without a pull-down: it floats while SPE is 0 (RM0090 28.3.1; embassy #1094)");
        }
    } else if (at == SPI_DR) {
        poke(SPI_SR, 3);
    }
}

static void flash(uint32_t at, uint32_t old, uint32_t value)
{
    const uint32_t cr = peek(FLASH_CR);
    if (at == KEYR && !(cr & LOCKED)) {
        break_rule("FLASH_KEYR written while unlocked: a bus fault (RM0090 3.6.1; qmk #13841)");
    } else if (at == KEYR) {
        keys = keys == 0 && value == 0x45670123u ? 1 : keys == 1 && value == 0xCDEF89ABu ? 2 : 0;
        poke(FLASH_CR, keys == 2 ? cr & ~LOCKED : cr);
    } else if (at == FLASH_SR) {
        poke(FLASH_SR, old & ~(value & 0xF2));
    } else if (at == FLASH_CR) {
        if (old & LOCKED && !(value & LOCKED)) {
            break_rule("FLASH_CR written while locked (RM0090 3.6.1)");
            poke(FLASH_CR, old);
        } else if (value & 1u << 16) {
            if (busy_reads != 0 || (value & 0x302) != 0x202) {
                break_rule("an erase begun while busy, or not as one by 32 bits (RM0090 3.6.3)");
            }
            memset((void *)(uintptr_t)(0x08000000u + (value >> 3 & 15) * 0x4000), 0xFF, 0x4000);
            now_ns += ERASE_MOST_NS;
            busy_reads = 3;
            poke(FLASH_SR, 1u << 16);
            poke(FLASH_CR, value & ~(1u << 16));
        }
        keys = value & LOCKED ? 0 : keys;
    } else if (at - 0x08000000u < 0x10000) {
        if (cr & LOCKED || (cr & 0x301) != 0x201 || busy_reads != 0 || old != 0xFFFFFFFFu) {
            break_rule("flash written while locked, busy, not by 32 bits or not erased (RM0090 3.6.4)");
        }
        busy_reads = 2;
        poke(FLASH_SR, 1u << 16);
    }
}

static void watchdog(uint32_t at, uint32_t value)
{
    if (at != IWDG) {
        if (!iwdg_open) {
            break_rule("IWDG_PR or IWDG_RLR written while locked (RM0090 21.3.2)");
        }
        return;
    }
    iwdg_open = value == 0x5555;
    iwdg_runs = iwdg_runs || value == 0xCCCC;
    if (value == 0xCCCC && (peek(DBG_FZ) & (1u << 12 | 1)) != (1u << 12 | 1)) {
        break_rule(
            "a halt by a debugger resets the board: DBGMCU_APB1_FZ stops IWDG and TIM2 (RM0090 38.16.4)");
    }
    fed_ns = value == 0xAAAA || value == 0xCCCC ? now_ns : fed_ns;
}

void on_write(uint32_t at, uint32_t old, uint32_t value)
{
    touch(at);
    if (at == AHB1ENR || at == AHB2ENR || at == APB1ENR || at == APB2ENR) {
        enabled_at = accesses;
        enabled_in = at;
        enabled_bits = value & ~old;
    } else if (at - CR < 0x400 || at == ACR) {
        clocks(at, old, value);
    } else if (at - SPI_CR1 < 0x400) {
        spi(at, old, value);
    } else if (at - ACR < 0x400 || at - 0x08000000u < 0x10000) {
        flash(at, old, value);
    } else if (at - IWDG < 0x400) {
        watchdog(at, value);
    } else if (at == BRR && value < 16) {
        break_rule("a USART divided by less than one (RM0090 30.3.4)");
    } else if (at == 0x40020818u) { // GPIOC_BSRR
        gpio_c_out = (gpio_c_out & ~(value >> 16)) | (value & 0xFFFF);
    } else if (at == DBG_CR && value & 1) {
        break_rule("DBG_SLEEP, with which WFI may be followed by what is not there (ES0182 2.1.3)");
    } else if (at - 0xE000E100u < 16) {
        nvic_enabled[(at - 0xE000E100u) / 4] |= value;
    } else if (at - 0xE000E180u < 16) {
        nvic_enabled[(at - 0xE000E180u) / 4] &= ~value;
    }
}

void on_asm(const char *text)
{
    enabled_at = strstr(text, "dsb") != NULL ? 0 : enabled_at;
    if (strstr(text, "msr msp") != NULL) {
        longjmp(registers_left, 2); // into the ROM's loader
    }
}
