// The controller's memory: the place of each endpoint's data, and the handover of buffers.
#ifndef BIOTAC_RP2_USB_BUFFERS_H
#define BIOTAC_RP2_USB_BUFFERS_H

#include <stdint.h>

#define USB_NOTIFY_BUFFER   0x180u
#define USB_DATA_IN_BUFFER  0x1C0u
#define USB_DATA_OUT_BUFFER 0x200u

// Data of a buffer, by its offset.
volatile uint8_t *usb_memory(uint32_t offset);

// Hand a buffer to the controller. control: a USB_BUFFER_IN or _OUT register; flags without AVAILABLE.
void usb_hand_over(volatile uint32_t *control, uint32_t flags);

#endif
