// Endpoint 0: standard requests (USB 2.0, 9.4) and those of a CDC-ACM port (PSTN 1.2, 6.3). Any other request
// is stalled.
#include "usb/control.h"

#include "rp2_regs.h"
#include "usb/buffers.h"
#include "usb/data.h"
#include "usb/descriptors.h"

#include <stdbool.h>
#include <stddef.h>

// bmRequestType | bRequest << 8
enum {
    GET_DEVICE_STATUS = 0x0080,
    GET_INTERFACE_STATUS = 0x0081,
    GET_ENDPOINT_STATUS = 0x0082,
    CLEAR_ENDPOINT_FEATURE = 0x0102,
    SET_ADDRESS = 0x0500,
    GET_DESCRIPTOR = 0x0680,
    GET_CONFIGURATION = 0x0880,
    SET_CONFIGURATION = 0x0900,
    GET_INTERFACE = 0x0A81,
    SET_INTERFACE = 0x0B01,
    SET_LINE_CODING = 0x2021,
    GET_LINE_CODING = 0x21A1,
    SET_CONTROL_LINE_STATE = 0x2221,
};

enum { DESCRIPTOR_DEVICE = 1, DESCRIPTOR_CONFIGURATION = 2, DESCRIPTOR_STRING = 3 };

#define LINE_CODING_BYTES 7
#define STRING_BYTES      64
#define ENGLISH           0x0409
#define LINE_STATE_DTR    1
#define SETUP_TRIES       4 // at full speed the next one is 10 us away

static const char *serial_number;
static const uint8_t *sending; // the part of the answer still to go
static uint32_t sending_bytes;
static bool empty_packet_due; // a full last packet does not end an answer that is shorter than asked for
static uint32_t toggle_in;
static uint8_t new_address;
static uint8_t configuration;
static bool line_coding_due;
static uint8_t line_coding[LINE_CODING_BYTES] = {0x00, 0xC2, 0x01, 0x00, 0, 0, 8}; // 115200 8N1
static uint8_t text[STRING_BYTES];

void usb_control_start(const char *serial)
{
    serial_number = serial;
}

void usb_control_bus_reset(void)
{
    USB_ADDR_ENDP = 0;
    new_address = 0;
    configuration = 0;
    sending_bytes = 0;
    empty_packet_due = false;
    line_coding_due = false;
    usb_data_configure(false);
}

// ---- the stages of a request -----------------------------------------------------------------------------

// True when the host has begun another request: the answer to the earlier one must not reach it. The
// interrupt comes again.
static bool superseded(void)
{
    return USB_SIE_STATUS & USB_SIE_SETUP_REC;
}

static void send_packet(void)
{
    uint32_t bytes = sending_bytes < USB_PACKET_BYTES ? sending_bytes : USB_PACKET_BYTES;
    volatile uint8_t *out = usb_memory(USB_EP0_BUFFER);
    for (uint32_t k = 0; k < bytes; k++) {
        out[k] = sending[k];
    }
    sending += bytes;
    sending_bytes -= bytes;
    empty_packet_due = empty_packet_due && bytes == USB_PACKET_BYTES;
    if (superseded()) { // checked last: the copy may last from one request to the next
        return;
    }
    usb_hand_over(&USB_BUFFER_IN(0), bytes | USB_BUFFER_FULL | toggle_in);
    toggle_in ^= USB_BUFFER_DATA1;
}

static void receive(uint32_t bytes)
{
    if (!superseded()) {
        usb_hand_over(&USB_BUFFER_OUT(0), bytes | USB_BUFFER_DATA1);
    }
}

static void answer(const uint8_t *data, uint32_t bytes, uint32_t asked)
{
    sending = data;
    sending_bytes = bytes < asked ? bytes : asked;
    empty_packet_due = bytes < asked;
    toggle_in = USB_BUFFER_DATA1;
    send_packet();
    receive(USB_PACKET_BYTES); // the host's empty packet that ends the request
}

static void accept(void)
{
    sending_bytes = 0;
    empty_packet_due = false;
    toggle_in = USB_BUFFER_DATA1;
    send_packet();
}

static void refuse(void)
{
    if (superseded()) {
        return;
    }
    USB_EP_STALL_ARM = USB_STALL_EP0_IN | USB_STALL_EP0_OUT;
    USB_BUFFER_IN(0) = USB_BUFFER_STALL;
    USB_BUFFER_OUT(0) = USB_BUFFER_STALL;
}

// ---- requests ------------------------------------------------------------------------------------

static uint32_t string_descriptor(uint32_t index)
{
    uint32_t bytes = 2;
    const char *from = index == USB_STRING_SERIAL ? serial_number : usb_string[index];
    if (index == USB_STRING_LANGUAGE) {
        text[bytes++] = ENGLISH & 0xFF;
        text[bytes++] = ENGLISH >> 8;
    } else {
        for (; *from != '\0' && bytes < STRING_BYTES; from++) { // UTF-16
            text[bytes++] = (uint8_t)*from;
            text[bytes++] = 0;
        }
    }
    text[0] = (uint8_t)bytes;
    text[1] = DESCRIPTOR_STRING;
    return bytes;
}

static void get_descriptor(uint32_t kind, uint32_t index, uint32_t asked)
{
    if (kind == DESCRIPTOR_DEVICE) {
        answer(usb_device_descriptor, sizeof usb_device_descriptor, asked);
    } else if (kind == DESCRIPTOR_CONFIGURATION && index == 0) {
        answer(usb_config_descriptor, sizeof usb_config_descriptor, asked);
    } else if (kind == DESCRIPTOR_STRING && index < USB_STRINGS) {
        answer(text, string_descriptor(index), asked);
    } else {
        refuse();
    }
}

static void set_configuration(uint32_t value)
{
    if (value > 1) {
        refuse();
        return;
    }
    configuration = (uint8_t)value;
    usb_data_configure(configuration != 0);
    accept();
}

static void read_setup(uint8_t setup[8])
{
    // A host may begin another request at any time (USB 2.0, 8.4.6.4). Packets armed for the earlier one go
    // first, while SETUP_REC still holds the host off; a packet that arrives while it is read is read again.
    USB_BUFFER_IN(0) = 0;
    USB_BUFFER_OUT(0) = 0;
    USB_BUFF_STATUS = USB_EP0_BUFFERS;
    sending_bytes = 0;
    empty_packet_due = false;
    for (int tries = 0; superseded() && tries < SETUP_TRIES; tries++) {
        USB_SIE_STATUS = USB_SIE_SETUP_REC; // writing 1 clears
        for (int k = 0; k < 8; k++) {
            setup[k] = usb_memory(0)[k];
        }
    }
}

void usb_control_setup(void)
{
    static const uint8_t zeros[2];
    uint8_t setup[8] = {0};
    read_setup(setup);
    uint32_t value = setup[2] | (uint32_t)setup[3] << 8;
    uint32_t index = setup[4] | (uint32_t)setup[5] << 8;
    uint32_t asked = setup[6] | (uint32_t)setup[7] << 8;
    uint32_t request = setup[0] | (uint32_t)setup[1] << 8;
    if ((request == (SET_LINE_CODING & ~1) || request == (SET_CONTROL_LINE_STATE & ~1)) && index == 0) {
        request |= 1; // sent to the device instead of the interface
    }
    line_coding_due = false; // a new request ends the one before at any stage
    new_address = 0;
    switch (request) {
    case GET_DESCRIPTOR:
        get_descriptor(value >> 8, value & 0xFF, asked);
        break;
    case SET_ADDRESS:
        new_address = (uint8_t)(value & 0x7F);
        accept(); // under the old address
        break;
    case SET_CONFIGURATION:
        set_configuration(value);
        break;
    case GET_CONFIGURATION:
        answer(&configuration, 1, asked);
        break;
    case GET_DEVICE_STATUS: // bus-powered, no remote wake-up
    case GET_INTERFACE_STATUS:
    case GET_ENDPOINT_STATUS: // never halted
        answer(zeros, 2, asked);
        break;
    case CLEAR_ENDPOINT_FEATURE:
        usb_data_reset_toggle((uint8_t)index);
        accept();
        break;
    case GET_INTERFACE: // none has alternatives
        answer(zeros, 1, asked);
        break;
    case SET_INTERFACE:
        if (value == 0) {
            accept();
        } else {
            refuse();
        }
        break;
    case SET_LINE_CODING:
        line_coding_due = true;
        receive(LINE_CODING_BYTES);
        break;
    case GET_LINE_CODING:
        answer(line_coding, LINE_CODING_BYTES, asked);
        break;
    case SET_CONTROL_LINE_STATE:
        usb_data_line_state(value & LINE_STATE_DTR);
        accept();
        break;
    default:
        refuse();
        break;
    }
}

void usb_control_in_done(void)
{
    if (new_address != 0) {
        USB_ADDR_ENDP = new_address;
        new_address = 0;
    }
    if (sending_bytes > 0 || empty_packet_due) {
        send_packet();
    }
}

void usb_control_out_done(void)
{
    if (!line_coding_due) {
        return; // the empty packet that ends a request
    }
    line_coding_due = false;
    if ((USB_BUFFER_OUT(0) & USB_BUFFER_LENGTH) != LINE_CODING_BYTES) {
        refuse();
        return;
    }
    for (int k = 0; k < LINE_CODING_BYTES; k++) {
        line_coding[k] = usb_memory(USB_EP0_BUFFER)[k];
    }
    usb_data_line_rate((uint32_t)line_coding[0] | (uint32_t)line_coding[1] << 8
                       | (uint32_t)line_coding[2] << 16 | (uint32_t)line_coding[3] << 24);
    accept();
}
