#include "system.h"

#include "pins.h"
#include "wait.h"

// As in boot2.S. Longer than an erase: 0.4 s at most on a Pico, a second on some chips.
#define WATCHDOG_US 2000000u

#include "chip_start.h"

// clk_ref is the crystal's 12 MHz; PLL output = 12 MHz * fbdiv / (postdiv1 * postdiv2), with the oscillator
// inside (12 MHz * fbdiv) between 750 and 1600 MHz.
#define CRYSTAL_MHZ 12u

// 6 ms for the crystal to start, in units of 256 periods (data sheet 2.16.3): a Pico's needs that from cold
// to full swing (measured in pico-sdk #2234).
#define XOSC_STARTUP_DELAY ((6u * CRYSTAL_MHZ * 1000u + 255u) / 256u)

AT_BOOT static bool start_pll(uint32_t base, uint32_t fbdiv, uint32_t postdiv1, uint32_t postdiv2)
{
    PLL_CS(base) = 1; // reference divider
    PLL_FBDIV_INT(base) = fbdiv;
    REG_CLR(PLL_PWR(base)) = PLL_PWR_PD | PLL_PWR_VCOPD;
    if (!wait_for(&PLL_CS(base), PLL_CS_LOCK, PLL_CS_LOCK, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    PLL_PRIM(base) = postdiv1 << 16 | postdiv2 << 12;
    REG_CLR(PLL_PWR(base)) = PLL_PWR_POSTDIVPD;
    return true;
}

// In scratch 2: starts in a row that ended before port_init.
#define STARTS 0x42540000u

uint16_t count_early_faults(void)
{
    const uint16_t before = (uint16_t)(WATCHDOG_SCRATCH2 - STARTS - 1);
    WATCHDOG_SCRATCH2 = STARTS;
    return before;
}

AT_BOOT bool clocks_start(void)
{
    chip_watchdog_start();
    WATCHDOG_SCRATCH2 = (WATCHDOG_SCRATCH2 >> 16 == STARTS >> 16 ? WATCHDOG_SCRATCH2 : STARTS) + 1;
    CLK_SYS_RESUS_CTRL = 0;
    XOSC_STARTUP = XOSC_STARTUP_DELAY;
    XOSC_CTRL = XOSC_CTRL_1_15MHZ | XOSC_CTRL_ENABLE;
    if (!wait_for(&XOSC_STATUS, XOSC_STABLE, XOSC_STABLE, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    // Away from the PLLs before they are touched: after a watchdog reset they may be in use.
    REG_CLR(CLK_SYS_CTRL) = CLK_SYS_SRC_AUX;
    if (!wait_for(&CLK_SYS_SELECTED, 1u << 0, 1u << 0, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    CLK_REF_CTRL = CLK_REF_SRC_XOSC;
    if (!wait_for(&CLK_REF_SELECTED, 1u << CLK_REF_SRC_XOSC, 1u << CLK_REF_SRC_XOSC, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    chip_undivide_clocks();
    if (!reset_blocks(RESETS_PLL_SYS | RESETS_PLL_USB)
        || !start_pll(PLL_SYS_BASE, 125, 6, 2)    // 1500 / 12 = 125 MHz
        || !start_pll(PLL_USB_BASE, 100, 5, 5)) { // 1200 / 25 = 48 MHz
        return false;
    }
    CLK_SYS_CTRL = 0;
    CLK_SYS_CTRL = CLK_SYS_SRC_AUX;
    if (!wait_for(&CLK_SYS_SELECTED, 1u << CLK_SYS_SRC_AUX, 1u << CLK_SYS_SRC_AUX, WAIT_CLOCKS_TURNS)) {
        return false;
    }
    CLK_PERI_CTRL = CLK_ENABLE; // from clk_sys
    CLK_USB_CTRL = CLK_ENABLE;  // from PLL_USB
    if (!reset_blocks(RESETS_DMA | RESETS_IO_BANK0 | RESETS_PADS_BANK0 | RESETS_SPI0 | RESETS_SYSINFO
                      | RESETS_TIMER | RESETS_USBCTRL)) {
        return false;
    }
    chip_ticks_start();
#ifdef PIN_LED
    SIO_GPIO_OUT_SET = 1u << PIN_LED; // there are clocks; port_idle blinks
    SIO_GPIO_OE_SET = 1u << PIN_LED;
    PADS_BANK0_GPIO(PIN_LED) = PADS_DRIVE_4MA | PADS_SCHMITT | PADS_IE; // an RP2350's is isolated until then
    IO_BANK0_GPIO_CTRL(PIN_LED) = GPIO_FUNC_SIO;
#endif
    return true;
}

void watchdog_feed(void)
{
    WATCHDOG_LOAD = WATCHDOG_LOADS_OF_A_US * WATCHDOG_US;
}

AT_BOOT void early_reset(void)
{
    WATCHDOG_CTRL = WATCHDOG_TRIGGER;
    for (;;) { // some cycles at most: the reset is on its way
    }
}

void system_reset(void)
{
    WATCHDOG_CTRL = WATCHDOG_TRIGGER;
    for (;;) { // some cycles at most: the reset is on its way
    }
}
