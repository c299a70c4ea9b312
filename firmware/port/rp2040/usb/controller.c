// The USB device controller in device mode: its interrupt, and a start over when it hears nothing any more.
#include "only_board.h"

#include "rp2040_regs.h"
#include "system.h"
#include "usb/buffers.h"
#include "usb/control.h"
#include "usb/data.h"
#include "usb/descriptors.h"
#include "wait.h"

#define DATA_IN  (1u << (2 * USB_EP_DATA))
#define DATA_OUT (1u << (2 * USB_EP_DATA + 1))
#define EP0_IN   (1u << 0)
#define EP0_OUT  (1u << 1)

// RP2040-E15: bus errors in an IN transfer, of which a corrupt handshake behind a hub is one, can stop the
// controller for good: it hears neither tokens nor bus resets, and so no start of frame, which a host sends
// every millisecond even while nobody reads. Only a reset of the block helps.
#define HEARS_NOTHING_US 100000u
#define OFF_THE_BUS_US   20000u // so that a hub sees it leave

static const char *serial_number;

static void buffers_done(void)
{
    uint32_t done = USB_BUFF_STATUS;
    USB_BUFF_STATUS = done; // writing 1 clears
    if (done & EP0_IN) {
        usb_control_in_done();
    }
    if (done & EP0_OUT) {
        usb_control_out_done();
    }
    if (done & DATA_IN) {
        usb_data_sent();
    }
    if (done & DATA_OUT) {
        usb_data_received();
    }
}

static void usb_interrupt(void)
{
    uint32_t status = USB_INTS;
    // Buffers before SETUP: they belong to the request before it.
    if (status & USB_INT_BUFF_STATUS) {
        buffers_done();
    }
    if (status & USB_INT_SETUP_REQ) {
        usb_data_suspend(false);
        usb_control_setup();
    }
    if (status & USB_INT_BUS_RESET) {
        USB_SIE_STATUS = USB_SIE_BUS_RESET; // writing 1 clears, here and below
        usb_data_suspend(false);
        usb_control_bus_reset();
    }
    if (status & USB_INT_SUSPEND) {
        USB_SIE_STATUS = USB_SIE_SUSPENDED;
        usb_data_suspend(true);
    }
    if (status & USB_INT_RESUME) {
        USB_SIE_STATUS = USB_SIE_RESUME;
        usb_data_suspend(false);
    }
    wake();
}

void usb_start(const char *serial)
{
    serial_number = serial;
    usb_control_start(serial);
    for (uint32_t offset = 0; offset < USB_EP0_BUFFER; offset += 4) {
        REG32(USB_DPRAM_BASE + offset) = 0; // it comes up with anything in it
    }
    USB_USB_MUXING = USB_MUXING_TO_PHY | USB_MUXING_SOFTCON;
    // The Pico does not connect VBUS to the controller's detection: say that it is there.
    USB_USB_PWR = USB_PWR_VBUS_DETECT | USB_PWR_VBUS_OVERRIDE;
    USB_EP_IN_CONTROL(USB_EP_NOTIFY) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_INTERRUPT | USB_NOTIFY_BUFFER;
    USB_EP_IN_CONTROL(USB_EP_DATA) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_BULK | USB_DATA_IN_BUFFER;
    USB_EP_OUT_CONTROL(USB_EP_DATA) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_BULK | USB_DATA_OUT_BUFFER;
    USB_SIE_CTRL = USB_SIE_EP0_INT_1BUF;
    USB_INTE = USB_INT_BUFF_STATUS | USB_INT_SETUP_REQ | USB_INT_BUS_RESET | USB_INT_SUSPEND | USB_INT_RESUME;
    use_interrupt(USBCTRL_IRQ, 3, usb_interrupt); // sampling goes first
    USB_MAIN_CTRL = USB_CONTROLLER_EN;
    REG_SET(USB_SIE_CTRL) = USB_SIE_PULLUP_EN; // now the host sees a device
}

uint32_t usb_starts;

void usb_watch(void)
{
    static uint32_t frame, since_us, latest;
    static bool off;
    uint32_t now_us = port_now_us(ONLY_BOARD);
    if (latest != USB_SOF_RD) {
        latest = USB_SOF_RD;
        usb_starts++;
    }
    if (off) {
        if (now_us - since_us >= OFF_THE_BUS_US) {
            off = false;
            usb_start(serial_number);
        }
        return;
    }
    if (!usb_data_waits() || frame != USB_SOF_RD) {
        frame = USB_SOF_RD;
        since_us = now_us;
    } else if (now_us - since_us >= HEARS_NOTHING_US) {
        interrupt_hold_off(USBCTRL_IRQ);
        usb_control_bus_reset();
        (void)take_out_of_reset(RESETS_USBCTRL);
        off = true;
        since_us = now_us;
    }
}
