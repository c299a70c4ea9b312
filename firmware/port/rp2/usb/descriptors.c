#include "usb/descriptors.h"

#include "pins.h"
#include "version.h"
#include "wire/messages_gen.h"

#include <stddef.h>

#define LOW(x)  ((x) & 0xFF)
#define HIGH(x) ((x) >> 8)

#define VERSION (BT_VERSION_MAJOR << 8 | BT_VERSION_MINOR << 4 | BT_VERSION_PATCH) // binary-coded decimal
_Static_assert(BT_VERSION_MAJOR < 10 && BT_VERSION_MINOR < 10 && BT_VERSION_PATCH < 10, "one digit each");

// USB 2.0, table 9-8.
// clang-format off: one item a line
const uint8_t usb_device_descriptor[USB_DEVICE_BYTES] = {
    USB_DEVICE_BYTES, 1, // a device
    0x00, 0x02, // USB 2.0
    0xEF, 2, 1, // class: by interface associations (their ECN, table 1); Windows wants it with one
    USB_PACKET_BYTES, // of endpoint 0
    LOW(BT_USB_VENDOR), HIGH(BT_USB_VENDOR),
    LOW(BT_USB_PRODUCT), HIGH(BT_USB_PRODUCT),
    LOW(VERSION), HIGH(VERSION),
    1, 2, USB_STRING_SERIAL, // strings: maker, product, serial number
    1, // configurations
};
// clang-format on

// USB 2.0, tables 9-10, 9-12, 9-13; CDC 1.2, tables 15 to 18; PSTN 1.2, table 3.
// clang-format off: one item a line
const uint8_t usb_config_descriptor[USB_CONFIG_BYTES] = {
    9, 2, LOW(USB_CONFIG_BYTES), HIGH(USB_CONFIG_BYTES), // a configuration with all that follows
    2, 1, 0, 0x80, 50, // interfaces, its number, no name, from the bus, 100 mA
    8, 11, 0, 2, 2, 2, 0, 0, // interfaces 0 and 1 belong together: CDC-ACM
    9, 4, 0, 0, 1, 2, 2, 0, 0, // interface 0: control, one endpoint
    5, 0x24, 0, 0x20, 0x01, // CDC 1.2
    5, 0x24, 1, 0, 1, // no call management; data on interface 1
    4, 0x24, 2, 2, // line coding and control line state
    5, 0x24, 6, 0, 1, // interface 0 controls interface 1
    7, 5, 0x80 | USB_EP_NOTIFY, 3, USB_NOTIFY_BYTES, 0, 16, // interrupt, every 16 ms
    9, 4, 1, 0, 2, 10, 0, 0, 0, // interface 1: data, two endpoints
    7, 5, USB_EP_DATA, 2, USB_PACKET_BYTES, 0, 0, // bulk OUT
    7, 5, 0x80 | USB_EP_DATA, 2, USB_PACKET_BYTES, 0, 0, // bulk IN
};
// clang-format on

const char *const usb_string[USB_STRINGS] = {NULL, "BioTac gateway", IMAGE_PRODUCT, NULL};
