// Reset, the vector table and faults on QEMU's mps2-an386. tests/core, tools/bench and whatever else runs on
// this board begins here.
#include "semihosting.h"

#include <stdlib.h>

#define CFSR (*(volatile uint32_t *)0xE000ED28u)
#define BFAR (*(volatile uint32_t *)0xE000ED38u)

extern uint32_t image_data_from[], image_data_start[], image_data_end[], image_bss_start[], image_bss_end[];
extern uint32_t image_stack_bottom[], image_stack_top[];
extern void (*const image_constructors[])(void), (*const image_constructors_end[])(void);

int main(void);
void image_reset(void);

// librdimon's: opens stdin, stdout and stderr. Not in an image that does no input or output.
__attribute__((weak)) void initialise_monitor_handles(void);

// Place of the address of the instruction that was left, in words from the stack pointer.
#define STACKED_PC 6

__attribute__((noreturn, used)) static void fault(const uint32_t *frame)
{
    semihost_write("fault: ");
    if (frame < image_stack_bottom || frame + STACKED_PC >= image_stack_top) {
        semihost_write("the stack has grown past its end (m4f.ld)");
    } else {
        semihost_write("at 0x");
        semihost_write_hex(frame[STACKED_PC]);
    }
    semihost_write(", CFSR 0x");
    semihost_write_hex(CFSR);
    semihost_write(", BFAR 0x");
    semihost_write_hex(BFAR);
    semihost_write("; find the line: arm-none-eabi-addr2line -e IMAGE ADDRESS\n");
    (void)semihost(SYS_EXIT, EXIT_FAULT);
    for (;;) {
    }
}

// On a fresh stack: the old one may be the fault.
__attribute__((naked)) static void any_fault(void)
{
    __asm volatile("mrs r0, msp\n"
                   "ldr sp, =image_stack_top\n"
                   "b %c0\n" ::"i"(fault));
}

__attribute__((noreturn, used)) static void start(void)
{
    const uint32_t *from = image_data_from;
    for (uint32_t *to = image_data_start; to < image_data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = image_bss_start; to < image_bss_end; to++) {
        *to = 0;
    }
    if (initialise_monitor_handles != NULL) {
        initialise_monitor_handles();
    }
    for (void (*const *add)(void) = image_constructors; add < image_constructors_end; add++) {
        (*add)();
    }
    exit(main());
}

// The FPU must be on before any function that may save FPU registers.
__attribute__((naked)) void image_reset(void)
{
    __asm volatile("ldr r0, =0xE000ED88\n"
                   "ldr r1, [r0]\n"
                   "orr r1, r1, #0xF00000\n"
                   "str r1, [r0]\n"
                   "dsb\n"
                   "isb\n"
                   "b %c0\n" ::"i"(start));
}

// The core's own exceptions. No program here asks for an interrupt.
typedef void (*vector)(void);
#define EXCEPTIONS 16 // the first is the stack's top
__attribute__((section(".vectors"), used)) static const vector vectors[EXCEPTIONS] = {
    (vector)image_stack_top, image_reset, [2 ... EXCEPTIONS - 1] = any_fault};
