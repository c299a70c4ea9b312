// Endpoint 0, all called from the controller's interrupt.
#ifndef BIOTAC_RP2_USB_CONTROL_H
#define BIOTAC_RP2_USB_CONTROL_H

void usb_control_start(const char *serial);
void usb_control_bus_reset(void);
void usb_control_setup(void);    // a SETUP packet came
void usb_control_in_done(void);  // endpoint 0 sent a packet
void usb_control_out_done(void); // endpoint 0 received one

#endif
