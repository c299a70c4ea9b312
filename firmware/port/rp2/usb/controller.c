// The USB controller in device mode: the interrupt, and a restart when it hears nothing any more.
#include "only_board.h"

#include "pins.h"
#include "rp2_regs.h"
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

// RP2040-E15: bus errors in an IN transfer, such as a corrupt handshake behind a hub, can stop the controller
// for good: it hears neither tokens nor bus resets, nor the start of frame that a host sends every
// millisecond even without a reader. Only a reset of the block helps. data.c avoids the known causes; this
// is for all others.
#define SOF_TIMEOUT_US 100000u
#define SUSPENDED_US   3000u  // without a start of frame, USB 2.0, 7.1.7.6
#define OFF_THE_BUS_US 20000u // long enough for a hub to notice
#define BOUNCES_US     10000u // of a plug, or of a button on the sense pin of another board

// The controller reports a suspended bus. Alone this means little: it reports a change once, maybe long after
// the change back. So it counts while no frame has begun since.
static volatile bool suspend_reported;
volatile uint32_t usb_starts;

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

static void not_suspended(void)
{
    suspend_reported = false;
    usb_data_suspend(false);
}

static void usb_interrupt(void)
{
    uint32_t status = USB_INTS;
    // Buffers before SETUP: they belong to the request before it.
    if (status & USB_INT_BUFF_STATUS) {
        buffers_done();
    }
    if (status & USB_INT_SUSPEND) {
        suspend_reported = USB_SIE_STATUS & USB_SIE_SUSPENDED;
        USB_SIE_STATUS = USB_SIE_SUSPENDED; // writing 1 clears, here and below
    }
    if (status & USB_INT_RESUME) {
        USB_SIE_STATUS = USB_SIE_RESUME;
    }
    if (status & ~(USB_INT_SUSPEND | USB_INT_RESUME)) {
        not_suspended(); // nothing else arrives on a sleeping bus
    }
    if (status & USB_INT_SETUP_REQ) {
        usb_control_setup();
    }
    if (status & USB_INT_BUS_RESET) {
        USB_SIE_STATUS = USB_SIE_BUS_RESET;
        usb_control_bus_reset();
    }
    if (status & USB_INT_SOF) {
        (void)USB_SOF_RD; // reading clears
        usb_starts = usb_starts + 1;
        usb_data_frame();
    }
    if (status != USB_INT_SOF) {
        wake();
    }
}

static void attach(void)
{
    for (uint32_t offset = 0; offset < USB_EP0_BUFFER; offset += 4) {
        REG32(USB_DPRAM_BASE + offset) = 0; // random after power-on
    }
    USB_USB_MUXING = USB_MUXING_TO_PHY | USB_MUXING_SOFTCON;
    // The Pico does not connect VBUS to the controller's detection: claim that it is there.
    USB_USB_PWR = USB_PWR_VBUS_DETECT | USB_PWR_VBUS_OVERRIDE;
    USB_EP_IN_CONTROL(USB_EP_NOTIFY) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_INTERRUPT | USB_NOTIFY_BUFFER;
    USB_EP_IN_CONTROL(USB_EP_DATA) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_BULK | USB_DATA_IN_BUFFER;
    USB_EP_OUT_CONTROL(USB_EP_DATA) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_BULK | USB_DATA_OUT_BUFFER;
    USB_SIE_CTRL = USB_SIE_EP0_INT_1BUF;
    USB_INTE = USB_INT_BUFF_STATUS | USB_INT_SETUP_REQ | USB_INT_BUS_RESET | USB_INT_SUSPEND | USB_INT_RESUME
               | USB_INT_SOF;
    use_interrupt(USBCTRL_IRQ, 3, usb_interrupt); // sampling goes first
    USB_MAIN_CTRL = USB_CONTROLLER_EN;
    REG_SET(USB_SIE_CTRL) = USB_SIE_PULLUP_EN; // now the host sees a device
}

// True if a host supplies power: without one, nothing may pull its lines up (USB 2.0, 7.1.5). A board that
// cannot measure it assumes a host.
static bool has_host(uint32_t now_us)
{
#ifdef PIN_VBUS_SENSE
    static uint32_t for_us = BOUNCES_US, seen_us; // without power
    const bool powered = SIO_GPIO_IN >> PIN_VBUS_SENSE & 1;
    for_us = powered ? 0 : for_us >= BOUNCES_US ? BOUNCES_US : for_us + (now_us - seen_us);
    seen_us = now_us;
    return for_us < BOUNCES_US;
#else
    return true;
#endif
}

bool usb_receives_sof;
static bool off = true;
static uint32_t since_us = 0u - OFF_THE_BUS_US; // time of the latest frame, or of leaving the bus

static void detach(uint32_t now_us)
{
    interrupt_hold_off(USBCTRL_IRQ);
    usb_control_bus_reset();
    (void)reset_blocks(RESETS_USBCTRL);
    off = true;
    usb_receives_sof = false;
    since_us = now_us;
}

void usb_start(const char *serial)
{
    usb_control_start(serial);
#ifdef PIN_VBUS_SENSE
    // An open pin is a host; a Pico's divider (5.6 and 10 kOhm) is stronger than the pull.
    PADS_BANK0_GPIO(PIN_VBUS_SENSE) = PADS_IE | PADS_SCHMITT | PADS_PUE;
#endif
    usb_poll();
}

// In the main loop: a lasting report is a suspend; silence without one is a hang.
void usb_poll(void)
{
    static uint32_t frame;
    static bool line_moves;
    const uint32_t now_us = port_now_us(ONLY_BOARD);
    const uint32_t silent_us = now_us - since_us;
    if (off) {
        if (has_host(now_us) && silent_us >= OFF_THE_BUS_US) {
            off = false;
            attach();
        }
        return;
    }
    if (!has_host(now_us)) {
        detach(now_us);
        return;
    }
    if (frame != usb_starts) {
        frame = usb_starts;
        usb_receives_sof = true;
        since_us = now_us;
        line_moves = false;
        return;
    }
    if (silent_us < SUSPENDED_US) {
        return;
    }
    usb_receives_sof = false;
    // The lines of a sleeping bus do not change; if they do, a hung controller only believes the bus asleep.
    line_moves = line_moves || (USB_SIE_STATUS & USB_SIE_LINE_STATE) != USB_SIE_LINE_J;
    const bool expects = usb_data_configured() || USB_BUFFER_IN(0) & USB_BUFFER_AVAILABLE;
    if (suspend_reported && !line_moves) {
        interrupt_hold_off(USBCTRL_IRQ);
        usb_data_suspend(suspend_reported);
        interrupt_enable(USBCTRL_IRQ);
    } else if (expects && silent_us >= SOF_TIMEOUT_US) {
        detach(now_us);
    }
}
