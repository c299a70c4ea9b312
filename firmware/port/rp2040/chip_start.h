// This chip's part of clocks_start: none. boot2.S has started the watchdog, every divider is 1 after a reset,
// and the watchdog's tick is the timer's.
#ifndef BIOTAC_RP2040_CHIP_START_H
#define BIOTAC_RP2040_CHIP_START_H

static inline void chip_watchdog_start(void)
{
}

static inline void chip_undivide_clocks(void)
{
}

static inline void chip_ticks_start(void)
{
}

#endif
