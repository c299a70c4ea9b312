// The board's USB descriptors: one CDC-ACM serial port.
#ifndef BIOTAC_RP2_USB_DESCRIPTORS_H
#define BIOTAC_RP2_USB_DESCRIPTORS_H

#include <stdint.h>

#define USB_PACKET_BYTES    64 // of endpoint 0 and the bulk endpoints, the most full speed has
#define USB_NOTIFY_BYTES    8
#define USB_EP_NOTIFY       1 // IN, interrupt: never used, but required by the class
#define USB_EP_DATA         2 // IN and OUT, bulk
#define USB_DEVICE_BYTES    18
#define USB_CONFIG_BYTES    75
#define USB_STRINGS         4
#define USB_STRING_LANGUAGE 0
#define USB_STRING_SERIAL   3

extern const uint8_t usb_device_descriptor[USB_DEVICE_BYTES];
extern const uint8_t usb_config_descriptor[USB_CONFIG_BYTES];

// ASCII; NULL for the language list and the serial number, which the device makes up.
extern const char *const usb_string[USB_STRINGS];

#endif
