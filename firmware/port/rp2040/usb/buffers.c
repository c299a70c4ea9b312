#include "usb/buffers.h"

#include "rp2040_regs.h"

volatile uint8_t *usb_memory(uint32_t offset)
{
    return (volatile uint8_t *)(uintptr_t)(USB_DPRAM_BASE + offset);
}

// AVAILABLE a while after the rest: the controller has a clock of its own, and may otherwise see it first
// (data sheet 4.1.2.5.1). Two of its cycles are six of ours.
void usb_hand_over(volatile uint32_t *control, uint32_t flags)
{
    *control = flags;
    __asm volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop" ::: "memory");
    *control = flags | USB_BUFFER_AVAILABLE;
}
