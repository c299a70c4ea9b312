// Reset, the vector table, and what happens when the program goes wrong.
#include "rp2040_regs.h"

#include "system.h"

#include <string.h>

extern uint32_t image_ram_from[], image_ram_start[], image_ram_end[], image_bss_start[], image_bss_end[];
extern uint32_t image_stack_top[];

int main(int argc, char **argv);
void image_reset(void);

typedef void (*vector)(void);
#define EXCEPTIONS 16 // the core's own; the first is the stack's top
#define INTERRUPTS 26

// A fault, or an interrupt that nobody asked for: start again. A board that hangs holds a hand still.
static void start_again(void)
{
    system_reset();
}

// Where the chip looks at first.
__attribute__((section(".vectors"), used)) static const vector first_vectors[EXCEPTIONS] = {
    (vector)image_stack_top, image_reset, [2 ... EXCEPTIONS - 1] = start_again};

// The table that is used: it may be read while the flash may not.
static vector vectors[EXCEPTIONS + INTERRUPTS] __attribute__((aligned(256)));

static void use_vectors(void)
{
    memcpy(vectors, first_vectors, sizeof first_vectors);
    for (int k = 0; k < INTERRUPTS; k++) {
        vectors[EXCEPTIONS + k] = start_again;
    }
    vectors[EXCEPTIONS + TIMER_IRQ_0] = timer_interrupt;
    vectors[EXCEPTIONS + USBCTRL_IRQ] = usb_interrupt;
    VTOR = (uint32_t)(uintptr_t)vectors;
}

void use_interrupt(uint32_t number, void (*handler)(void))
{
    vectors[EXCEPTIONS + number] = handler;
}

// The only code, with what it calls, that runs from flash: it copies all other. At the full clock, because on
// the ring oscillator a word that takes the flash 256 cycles takes 40 us. Loops of its own and not memcpy,
// which is not there yet; the volatile keeps the compiler from putting the call back.
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
    if (!ticking) {
        start_again(); // without its crystal the board can neither keep time nor speak USB
    }
    use_vectors();
    (void)main(0, NULL);
    start_again();
}
