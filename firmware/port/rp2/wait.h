// The only waits of this port beside cortex_m.h's. A device that never becomes ready must not hang the board:
// every loop on a register is in these two, with a bound, and tools/image/waits.py refuses one anywhere else.
#ifndef BIOTAC_RP2_WAIT_H
#define BIOTAC_RP2_WAIT_H

#include "rp2_regs.h"

#include <stdbool.h>

// A turn has at least six cycles: 48 ns at 125 MHz, 0.5 us on the ring oscillator that the chip starts with.
#define WAIT_CLOCKS_TURNS 100000u // 50 ms at least: the crystal needs 6 ms, a PLL less
#define WAIT_SPI_TURNS    1000u   // 48 us at least: a word needs 4 us

// Into reset and out again: every register of these blocks is as after power-on. False when they do not come
// back. Inline, because boot calls it before there is code in SRAM, and the USB's guard after.
static inline bool reset_blocks(uint32_t blocks)
{
    REG_SET(RESETS_RESET) = blocks;
    REG_CLR(RESETS_RESET) = blocks;
    return wait_for(&RESETS_RESET_DONE, blocks, blocks, WAIT_CLOCKS_TURNS);
}

// At least us microseconds, and hardly more at the image's clock; longer on a slower one. For a few us, which
// the timer, ticking once in a us, would lengthen by up to two.
static inline void wait_short_us(uint32_t us)
{
    wait_cycles(us * (CLK_SYS_HZ / 1000000u));
}

// The same in nanoseconds, of a constant.
static inline void wait_short_ns(uint32_t ns)
{
    wait_cycles((ns * (CLK_SYS_HZ / 1000000u) + 999) / 1000);
}

// Discard data while (*status & more), words at most.
static inline void drain(const volatile uint32_t *status, uint32_t more, const volatile uint32_t *data,
                         uint32_t words)
{
    while ((*status & more) && words-- != 0) {
        (void)*data;
    }
}

// At least us microseconds; not for more than a second. The timer ticks while clk_ref runs, so the bound in
// turns is only reached when it does not.
static inline void wait_us(uint32_t us)
{
    uint32_t start_us = TIMER_TIMERAWL;
    uint32_t turns = 21 * (us + 1); // 21 turns of 48 ns to the us
    while (TIMER_TIMERAWL - start_us <= us && turns-- != 0) {
    }
}

#endif
