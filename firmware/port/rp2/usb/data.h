// The serial port's data, as reported by endpoint 0 and the controller in their interrupt.
#ifndef BIOTAC_RP2_USB_DATA_H
#define BIOTAC_RP2_USB_DATA_H

#include <stdbool.h>
#include <stdint.h>

void usb_data_configure(bool configured); // both toggles begin at DATA0
void usb_data_reset_toggle(uint8_t endpoint_address);
void usb_data_line_state(bool dtr);
void usb_data_line_rate(uint32_t bits_per_s);

void usb_data_suspend(bool suspended); // asleep, or unplugged while something else powers the board
void usb_data_frame(void);             // a frame of the bus begins
void usb_data_sent(void);              // the host has the last packet
void usb_data_received(void);          // one from the host is in the controller's memory

bool usb_data_configured(void);

#endif
