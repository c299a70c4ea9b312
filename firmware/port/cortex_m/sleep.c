#include "cortex_m.h"

#define NAPS 64 // interrupts until the main loop runs anyway: a slot has two, and the bus some

// A program in QEMU under -icount must not sleep: the clock would pass the alarm by as much as the host
// oversleeps.
#ifdef BOARD_NEVER_SLEEPS
#define REST "nop\n"
#else
#define REST "dsb\n .balign 8\n wfi\n" // elsewhere a probed F405 may run garbage (ES0182 2.1.3)
#endif

static volatile bool woken;

void wake(void)
{
    woken = true;
}

// A held-off interrupt still ends WFI: none can slip in between the check and the sleep.
void sleep_until_woken(void)
{
    __asm volatile("cpsid i" ::: "memory");
    for (int k = 0; k < NAPS && !woken; k++) {                        // most interrupts are the bus's own
        __asm volatile(REST " cpsie i\n isb\n cpsid i" ::: "memory"); // its handler runs here
    }
    woken = false;
    __asm volatile("cpsie i" ::: "memory");
}
