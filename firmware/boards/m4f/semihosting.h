// What an image asks of QEMU itself, by the ARM semihosting instruction. On silicon without a debugger it
// faults: one more reason why this board is no product.
#ifndef BIOTAC_M4F_SEMIHOSTING_H
#define BIOTAC_M4F_SEMIHOSTING_H

#include <stdint.h>

#define SYS_WRITE0 0x04u
#define SYS_EXIT   0x18u
#define EXIT_DONE  0x20026u // ADP_Stopped_ApplicationExit
#define EXIT_FAULT 0x20023u // ADP_Stopped_RunTimeErrorUnknown: QEMU's exit code is 1

static inline void semihost(uint32_t operation, uintptr_t argument)
{
    register uint32_t r0 __asm("r0") = operation;
    register uintptr_t r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

// To QEMU's stderr.
static inline void semihost_write(const char *text)
{
    semihost(SYS_WRITE0, (uintptr_t)text);
}

static inline void semihost_write_hex(uint32_t value)
{
    char text[9] = "";
    for (int k = 0; k < 8; k++) {
        text[k] = "0123456789abcdef"[value >> (28 - 4 * k) & 15];
    }
    semihost_write(text);
}

#endif
