// Interrupts, reset, short waits and sleep of a Cortex-M core, for every port. For ARMv6-M (M0+) to ARMv8-M;
// wait_cycles is too short on an M7.
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

// ---- one interrupt held off, and no other: for code that shares data with it
#define NVIC_ISER(number) REG32(0xE000E100u + 4u * ((number) / 32u))
#define NVIC_ICER(number) REG32(0xE000E180u + 4u * ((number) / 32u))
#define NVIC_IPR(number)  REG32(0xE000E400u + 4u * ((number) / 4u)) // an M0+ has whole words only
#define SCB_SHPR3         REG32(0xE000ED20u)                        // the upper byte is SysTick's priority

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
#define SYSTICK (-1) // number of the exception

// Set the handler of an interrupt and enable it; one without a handler resets the board. priority: 0 goes
// first, 3 last; an interrupt interrupts those of a larger number.
void use_interrupt(int number, uint32_t priority, void (*handler)(void));

// ---- image_note.c
// True if the stored image, and the part copied to RAM, have the CRC-32 of the build, or if no build has
// sealed it, as in QEMU. Call it before any of the image runs.
bool image_is_whole(void);
uint32_t image_crc32(void); // the CRC-32 then; see port.h

// ---- defined by the port for startup.c
// Starts the clocks, and that of port_now_us. Runs before there are any variables, from the stored image:
// mark it and its callees with AT_BOOT. False when a clock never came up: the board starts again.
bool clocks_start(void);

// Also after a fault, or an interrupt without a handler.
void system_reset(void) __attribute__((noreturn));
void early_reset(void) __attribute__((noreturn)); // AT_BOOT: RAM is not reliable yet

// noinline, or it would end up in a caller outside the section.
#define AT_BOOT __attribute__((section(".boot_code"), noinline))

// ---- waits: at least so many cycles, of a constant
#define WAIT_TURN_CYCLES 3u
static inline void wait_cycles(uint32_t cycles)
{
    uint32_t turns = cycles / WAIT_TURN_CYCLES + 1;
    __asm volatile(".syntax unified\n1: subs %0, #1\n bne 1b" : "+l"(turns) : : "cc");
}

// Until (*reg & mask) == value. False after so many turns of at least six cycles.
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
// Call from port_init. core_hz: SysTick's rate. The alarm's interrupt has priority 1, so that a UART without
// a FIFO goes first.
void systick_alarm_start(uint32_t core_hz);
uint32_t clock_us(void); // the port's: 32 bits of us that wrap, from any context

// ---- sleep.c
// For interrupts: the main loop has work.
void wake(void);

// Until an interrupt calls wake; returns at once when one has since the last call.
void sleep_until_woken(void);

#endif
