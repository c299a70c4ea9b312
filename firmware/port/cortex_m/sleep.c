#include "cortex_m.h"

#define NAPS 64 // interrupts until the main loop looks around all the same: a slot has two, and the bus some

// A program in QEMU under -icount must not sleep: its clock would go past the alarm by as much as its host
// oversleeps.
#ifdef BOARD_NEVER_SLEEPS
#define REST "nop\n"
#else
#define REST "dsb\n .balign 8\n wfi\n" // elsewhere a probed F405 may run what is not there (ES0182 2.1.3)
#endif

static volatile bool woken;

void wake(void)
{
    woken = true;
}

// Interrupts are held off, and still one of them ends WFI: none can slip in between looking and sleeping.
void sleep_until_woken(void)
{
    __asm volatile("cpsid i" ::: "memory");
    for (int k = 0; k < NAPS && !woken; k++) {                        // most interrupts are the bus's own
        __asm volatile(REST " cpsie i\n isb\n cpsid i" ::: "memory"); // its handler runs here
    }
    woken = false;
    __asm volatile("cpsie i" ::: "memory");
}
