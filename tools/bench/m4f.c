// The bench image's start on QEMU's mps2-an386, a Cortex-M4F. QEMU logs the address of each instruction
// it runs; names and results go out by semihosting.
#include "mark.h"

#define SYS_WRITE0 0x04u
#define SYS_EXIT   0x18u
#define EXIT_DONE  0x20026u // ADP_Stopped_ApplicationExit

extern uint32_t stack_top;
int main(void);

static void semihost(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

__attribute__((noipa, used)) void bench_mark(void)
{
    __asm volatile("" ::: "memory");
}

void bench_name(const char *kernel, const char *scene)
{
    semihost(SYS_WRITE0, kernel);
    semihost(SYS_WRITE0, "\t");
    semihost(SYS_WRITE0, scene);
    semihost(SYS_WRITE0, "\n");
}

void bench_result(uint32_t value)
{
    char text[10];
    for (int k = 0; k < 8; k++) {
        text[k] = "0123456789abcdef"[value >> (28 - 4 * k) & 15];
    }
    text[8] = '\n';
    text[9] = 0;
    semihost(SYS_WRITE0, text);
}

void bench_end(void)
{
    semihost(SYS_EXIT, (const void *)EXIT_DONE);
}

__attribute__((noreturn, used)) static void start(void)
{
    (void)main();
    for (;;) {
    }
}

// The FPU must be on before any function that may save its registers.
__attribute__((naked)) static void reset(void)
{
    __asm volatile("ldr r0, =0xE000ED88\n"
                   "ldr r1, [r0]\n"
                   "orr r1, r1, #0xF00000\n"
                   "str r1, [r0]\n"
                   "dsb\n"
                   "isb\n"
                   "b start\n");
}

__attribute__((section(".vectors"), used)) static const void *const vectors[2] = {&stack_top, reset};
