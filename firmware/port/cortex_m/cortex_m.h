// What every Cortex-M port needs of its core: interrupts, reset, short waits and sleep. For ARMv6-M (M0+) to
// ARMv8-M; not for the M7 as far as wait_cycles goes, which that core runs through too fast.
#ifndef BIOTAC_CORTEX_M_H
#define BIOTAC_CORTEX_M_H

#include <stdbool.h>
#include <stdint.h>

#define REG32(address) (*(volatile uint32_t *)(uintptr_t)(address))

// ---- all interrupts held off, for the few cycles in which two must see the same
static inline uint32_t interrupts_disable(void)
{
    uint32_t primask;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(primask)::"memory");
    return primask;
}

static inline void interrupts_restore(uint32_t primask)
{
    __asm volatile("msr primask, %0" ::"r"(primask) : "memory");
}

// ---- one interrupt held off, and no other: for who shares something with it
#define NVIC_ISER(number) REG32(0xE000E100u + 4u * ((number) / 32u))
#define NVIC_ICER(number) REG32(0xE000E180u + 4u * ((number) / 32u))
#define NVIC_IPR(number)  REG32(0xE000E400u + 4u * ((number) / 4u)) // an M0+ takes whole words only
#define SCB_SHPR3         REG32(0xE000ED20u)                        // SysTick's priority is in its upper byte

static inline void interrupt_hold_off(uint32_t number)
{
    NVIC_ICER(number) = 1u << number % 32;
    __asm volatile("dsb\n isb" ::: "memory");
}

static inline void interrupt_enable(uint32_t number)
{
    __asm volatile("" ::: "memory");
    NVIC_ISER(number) = 1u << number % 32;
}

// ---- startup.c
#define SYSTICK (-1) // as an interrupt's number

// Who takes an interrupt; one that nobody takes resets the board. priority: 0 goes first, 3 last; an
// interrupt interrupts those of a larger number. It is enabled at once.
void use_interrupt(int number, uint32_t priority, void (*handler)(void));

// ---- image_note.c
// What is stored and what of it was copied to RAM have the CRC-32 that the build found. True of an image that
// no build has sealed, as in QEMU. Before anything of it runs.
bool image_is_whole(void);
uint32_t image_crc32(void); // which it then is; see port.h

// ---- what the port defines for startup.c
// Clocks, and the clock of port_now_us. Runs before there are any variables, from where the image is stored:
// mark it, and what it calls, with AT_BOOT. False when a clock never came up: the board starts again.
bool clocks_start(void);

// Also after a fault, or an interrupt that nobody asked for.
void system_reset(void) __attribute__((noreturn));
void early_reset(void) __attribute__((noreturn)); // AT_BOOT: nothing of RAM can be relied on

// noinline, or it would end up in its caller, or what it calls in it.
#define AT_BOOT __attribute__((section(".boot_code"), noinline))

// ---- waits: at least so many cycles, of a constant
#define WAIT_TURN_CYCLES 3u
static inline void wait_cycles(uint32_t cycles)
{
    uint32_t turns = cycles / WAIT_TURN_CYCLES + 1;
    __asm volatile(".syntax unified\n1: subs %0, #1\n bne 1b" : "+l"(turns) : : "cc");
}

// Until (*reg & mask) == value. False when it never was within so many turns of at least six cycles.
static inline bool wait_for(const volatile uint32_t *reg, uint32_t mask, uint32_t value, uint32_t turns)
{
    while ((*reg & mask) != value) {
        if (turns-- == 0) {
            return false;
        }
    }
    return true;
}

// ---- systick_alarm.c: port_now_us, port_delay_us and port_alarm_at on SysTick, over a clock of the port's
// Call from port_init. core_hz: what SysTick counts. The alarm's interrupt has priority 1, so that a UART
// without a FIFO goes before it.
void systick_alarm_start(uint32_t core_hz);
uint32_t clock_us(void); // the port's: 32 bits of us that wrap, from any context

// ---- sleep.c
// Something came that the main loop should look at. For interrupts.
void wake(void);

// Until an interrupt calls wake, or not at all when one has since the last call.
void sleep_until_woken(void);

#endif
