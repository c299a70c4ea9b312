// This chip's part of clocks_start: the boot ROM leaves the watchdog off and the clocks divided.
#ifndef BIOTAC_RP2350_CHIP_START_H
#define BIOTAC_RP2350_CHIP_START_H

#include "rp2_regs.h"

#define TICK_CYCLES 12u // of clk_ref, the crystal's 12 MHz: a tick every us

// Before anything that could go wrong: on the ring oscillator, which may run at 48 MHz or be divided by five,
// the two seconds are half a second to ten. PSM's bits select the blocks of a reset: all but the two
// oscillators.
static inline void chip_watchdog_start(void)
{
    WATCHDOG_CTRL = WATCHDOG_PAUSE_DEBUG;
    PSM_WDSEL = PSM_ALL_BUT_XOSC_ROSC;
    TICKS_WATCHDOG_CYCLES = TICK_CYCLES;
    TICKS_WATCHDOG_CTRL = TICKS_ENABLE;
    WATCHDOG_LOAD = WATCHDOG_LOADS_OF_A_US * WATCHDOG_US;
    WATCHDOG_CTRL = WATCHDOG_ENABLE | WATCHDOG_PAUSE_DEBUG;
}

// While clk_sys runs from clk_ref and that from the crystal. The ROM of the steppings A3 and A4 starts with
// clk_ref / 5 (data sheet, appendix C) and may leave it so: every clock and tick would be five times as slow.
static inline void chip_undivide_clocks(void)
{
    CLK_REF_DIV = CLK_DIV_ONE;
    CLK_SYS_DIV = CLK_DIV_ONE;
    CLK_PERI_DIV = CLK_DIV_ONE;
    CLK_USB_DIV = CLK_DIV_ONE;
    CLK_ADC_DIV = CLK_DIV_ONE;
}

// The timer stands still without a tick.
static inline void chip_ticks_start(void)
{
    TICKS_TIMER0_CYCLES = TICK_CYCLES;
    TICKS_TIMER0_CTRL = TICKS_ENABLE;
}

#endif
