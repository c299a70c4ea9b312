// Requests of an image to QEMU itself, by the ARM semihosting instruction. On silicon without a debugger they
// fault: nothing that includes this is for a board that one can buy.
#ifndef BIOTAC_SEMIHOSTING_H
#define BIOTAC_SEMIHOSTING_H

#include <stdint.h>

#define SYS_OPEN        0x01u
#define SYS_CLOSE       0x02u
#define SYS_WRITE0      0x04u
#define SYS_WRITE       0x05u
#define SYS_READ        0x06u
#define SYS_SEEK        0x0Au
#define SYS_FLEN        0x0Cu
#define SYS_GET_CMDLINE 0x15u
#define SYS_EXIT        0x18u
#define EXIT_DONE       0x20026u // ADP_Stopped_ApplicationExit
#define EXIT_FAULT      0x20023u // ADP_Stopped_RunTimeErrorUnknown: QEMU's exit code is 1

static inline uint32_t semihost(uint32_t operation, uintptr_t argument)
{
    register uint32_t r0 __asm("r0") = operation;
    register uintptr_t r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

// Write to QEMU's stderr.
static inline void semihost_write(const char *text)
{
    (void)semihost(SYS_WRITE0, (uintptr_t)text);
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
