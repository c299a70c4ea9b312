// The only waits of this port. A device that never becomes ready must not hang the board: every loop on a
// register is here, with a bound, and tools/image_check.py refuses one anywhere else.
#ifndef BIOTAC_RP2040_WAIT_H
#define BIOTAC_RP2040_WAIT_H

#include "rp2040_regs.h"

#include <stdbool.h>

// A turn takes at least six cycles: 48 ns at 125 MHz, 0.5 us on the ring oscillator that the chip starts
// with.
#define WAIT_CLOCKS_TURNS 100000u // 50 ms at least: the crystal takes 1 ms, a PLL less
#define WAIT_SPI_TURNS    1000u   // 48 us at least: a word takes 4 us

// Until (*reg & mask) == value. False when it never was within so many turns.
static inline bool wait_for(const volatile uint32_t *reg, uint32_t mask, uint32_t value, uint32_t turns)
{
    while ((*reg & mask) != value) {
        if (turns-- == 0) {
            return false;
        }
    }
    return true;
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
