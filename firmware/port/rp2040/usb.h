// The two halves of the USB device: usb_control.c speaks for endpoint 0, usb.c moves serial data.
#ifndef BIOTAC_RP2040_USB_H
#define BIOTAC_RP2040_USB_H

#include <stdbool.h>
#include <stdint.h>

// Data of a buffer in the controller's memory, by its offset.
volatile uint8_t *usb_memory(uint32_t offset);

// Hand a buffer to the controller. control: a USB_BUFFER_IN or _OUT register; flags without AVAILABLE.
void usb_hand_over(volatile uint32_t *control, uint32_t flags);

// ---- usb_control.c, all called from the interrupt
void usb_control_start(const char *serial);
void usb_control_bus_reset(void);
void usb_control_setup(void);    // a SETUP packet came
void usb_control_in_done(void);  // endpoint 0 sent a packet
void usb_control_out_done(void); // endpoint 0 received one

// ---- usb.c, told by usb_control.c
void usb_data_configure(bool configured); // both toggles begin at DATA0
void usb_data_reset_toggle(uint8_t endpoint_address);
void usb_data_line_state(bool dtr);
void usb_data_line_rate(uint32_t bits_per_s);

#endif
