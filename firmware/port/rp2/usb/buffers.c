#include "usb/buffers.h"

#include "rp2_regs.h"

volatile uint8_t *usb_memory(uint32_t offset)
{
    return (volatile uint8_t *)(uintptr_t)(USB_DPRAM_BASE + offset);
}

// AVAILABLE comes last, after a wait: the controller has a clock of its own and may otherwise see it first
// (data sheet 4.1.2.5.1). Two of those cycles are six of ours.
void usb_hand_over(volatile uint32_t *control, uint32_t flags)
{
    *control = flags;
    wait_cycles(6); // and no NOPs, which a Cortex-M33 folds into their neighbours
    *control = flags | USB_BUFFER_AVAILABLE;
}
