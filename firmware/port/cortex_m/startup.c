// Reset, the vector table, and the restart of a program that goes wrong.
#include "cortex_m.h"

#include <stddef.h>

#define EXCEPTIONS 16 // the core's own; the first is the stack's top
#ifdef __ARM_ARCH_6M__
#define INTERRUPTS 32
#else
#define INTERRUPTS 112 // more than any chip tried so far
#endif
#define VTOR REG32(0xE000ED08u)

// From the linker script: the part stored elsewhere and run from RAM, the zeroed part, and the stack.
extern uint32_t image_ram_from[], image_ram_start[], image_ram_end[], image_bss_start[], image_bss_end[];
extern uint32_t image_stack_top[];

int main(int argc, char **argv);
void image_reset(void);

// A board that hangs holds a hand still: start again.
static void start_again(void)
{
    system_reset();
}

typedef void (*vector)(void);

// The chip's first vectors, also in use during the copy.
__attribute__((section(".vectors"), used)) static const vector first_vectors[EXCEPTIONS] = {
    (vector)image_stack_top, image_reset, [2 ... EXCEPTIONS - 1] = early_reset};

// The table in RAM, readable while the flash is not. Aligned to its size, rounded up.
static vector vectors[EXCEPTIONS + INTERRUPTS] __attribute__((aligned(INTERRUPTS > 48 ? 512 : 256)));

static void use_vectors(void)
{
    for (int k = 0; k < EXCEPTIONS + INTERRUPTS; k++) {
        vectors[k] = start_again;
    }
    VTOR = (uint32_t)(uintptr_t)vectors;
}

// Every core has the two upper bits of a byte.
static uint32_t with_priority(uint32_t word, uint32_t byte, uint32_t priority)
{
    return (word & ~(0xFFu << 8 * byte)) | priority << (8 * byte + 6);
}

void use_interrupt(int number, uint32_t priority, void (*handler)(void))
{
    vectors[EXCEPTIONS + number] = handler;
    if (number < 0) {
        SCB_SHPR3 = with_priority(SCB_SHPR3, 3, priority);
        return;
    }
    const uint32_t n = (uint32_t)number;
    NVIC_IPR(n) = with_priority(NVIC_IPR(n), n % 4, priority);
    interrupt_enable(n);
}

// This function and its callees run from flash and copy all other code, at the full clock, because on a slow
// one a word of flash may need 40 us. Loops instead of memcpy, which may not be there yet; volatile stops the
// compiler from putting the call back.
AT_BOOT void image_reset(void)
{
    bool ticking = clocks_start();
    const uint32_t *from = image_ram_from;
    for (volatile uint32_t *to = image_ram_start; to < image_ram_end; to++) {
        *to = *from++;
    }
    for (volatile uint32_t *to = image_bss_start; to < image_bss_end; to++) {
        *to = 0;
    }
    if (!ticking || !image_is_whole()) {
        early_reset(); // without a crystal the board can neither measure time nor reach a host
    }
    use_vectors();
    (void)main(0, NULL);
    start_again();
}
