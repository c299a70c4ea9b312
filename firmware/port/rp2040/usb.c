// The USB device controller in device mode, and the serial port's data on it. Interrupts move packets;
// between them and the main loop stand two rings, each with one writer and one reader.
#include "port.h"

#include "dma.h"
#include "rp2040_regs.h"
#include "system.h"
#include "usb.h"
#include "usb_descriptors.h"
#include "wait.h"

#include <stdatomic.h>

#define TX_RING 4096 // 40 ms of five fingers' frames
#define RX_RING 256  // some commands; when it is full the host is told to wait
_Static_assert((TX_RING & (TX_RING - 1)) == 0 && (RX_RING & (RX_RING - 1)) == 0, "indices wrap");

// Where the endpoints' data lies in the controller's memory.
#define NOTIFY_BUFFER   0x180u
#define DATA_IN_BUFFER  0x1C0u
#define DATA_OUT_BUFFER 0x200u

#define DATA_IN  (1u << (2 * USB_EP_DATA))
#define DATA_OUT (1u << (2 * USB_EP_DATA + 1))
#define EP0_IN   (1u << 0)
#define EP0_OUT  (1u << 1)

#define TOUCH_BITS_PER_S 1200

// RP2040-E15: bus errors in an IN transfer, of which a corrupt handshake behind a hub is one, can stop the
// controller for good: it hears neither tokens nor bus resets, and so no start of frame, which a host sends
// every millisecond even while nobody reads. Only a reset of the block helps.
#define HEARS_NOTHING_US 100000u
#define OFF_THE_BUS_US   20000u // so that a hub sees it leave

static uint8_t tx[TX_RING];
static _Atomic uint32_t tx_head; // main loop; counts bytes ever put in
static _Atomic uint32_t tx_tail; // interrupt
static uint8_t rx[RX_RING];
static _Atomic uint32_t rx_head; // interrupt
static _Atomic uint32_t rx_tail; // main loop

static volatile bool configured;
static volatile bool suspended;
static volatile bool dtr;
static volatile bool touched;
static volatile bool in_busy; // the controller holds a packet for the host
static volatile bool out_armed;
static const char *serial_number;
static bool last_was_full;
static bool delimiter_due;
static uint32_t in_toggle;
static uint32_t out_toggle;
static uint32_t line_rate;

// Plain loads and stores: the Cortex-M0+ has no atomic read-modify-write, and one writer needs none.
static uint32_t get(_Atomic uint32_t *index)
{
    return atomic_load_explicit(index, memory_order_acquire);
}

static void set(_Atomic uint32_t *index, uint32_t value)
{
    atomic_store_explicit(index, value, memory_order_release);
}

volatile uint8_t *usb_memory(uint32_t offset)
{
    return (volatile uint8_t *)(uintptr_t)(USB_DPRAM_BASE + offset);
}

// AVAILABLE a while after the rest: the controller has a clock of its own, and may otherwise see it first
// (data sheet 4.1.2.5.1). Two of its cycles are six of ours.
void usb_hand_over(volatile uint32_t *control, uint32_t flags)
{
    *control = flags;
    __asm volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop" ::: "memory");
    *control = flags | USB_BUFFER_AVAILABLE;
}

// ---- data, in the interrupt or with it held off ----------------------------------------------------------

static bool link_open(void)
{
    return configured && dtr;
}

static uint32_t min(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void send_next(void)
{
    if (in_busy || !link_open()) {
        return;
    }
    volatile uint8_t *out = usb_memory(DATA_IN_BUFFER);
    uint32_t tail = get(&tx_tail);
    uint32_t waiting = get(&tx_head) - tail;
    uint32_t bytes = 0;
    if (delimiter_due) {
        out[bytes++] = 0;
        delimiter_due = false;
    }
    uint32_t taken = min(waiting, USB_PACKET_BYTES - bytes);
    uint32_t first = min(taken, TX_RING - tail % TX_RING); // the rest lies at the ring's start
    dma_copy(DMA_OF_USB, out + bytes, tx + tail % TX_RING, first);
    dma_copy(DMA_OF_USB, out + bytes + first, tx, taken - first);
    bytes += taken;
    tail += taken;
    // A host waits for more after a full packet; when there is none, an empty one tells it so.
    if (bytes == 0 && !last_was_full) {
        return;
    }
    set(&tx_tail, tail);
    last_was_full = bytes == USB_PACKET_BYTES;
    in_busy = true;
    usb_hand_over(&USB_BUFFER_IN(USB_EP_DATA), bytes | USB_BUFFER_FULL | in_toggle);
    in_toggle ^= USB_BUFFER_DATA1;
}

static void receive_next(void)
{
    if (out_armed || !configured || RX_RING - (get(&rx_head) - get(&rx_tail)) < USB_PACKET_BYTES) {
        return; // not armed: the controller makes the host wait
    }
    out_armed = true;
    usb_hand_over(&USB_BUFFER_OUT(USB_EP_DATA), USB_PACKET_BYTES | out_toggle);
    out_toggle ^= USB_BUFFER_DATA1;
}

static void received(void)
{
    uint32_t bytes = USB_BUFFER_OUT(USB_EP_DATA) & USB_BUFFER_LENGTH;
    uint32_t head = get(&rx_head);
    bytes = bytes < USB_PACKET_BYTES ? bytes : USB_PACKET_BYTES;
    for (uint32_t k = 0; k < bytes; k++) {
        rx[head++ % RX_RING] = usb_memory(DATA_OUT_BUFFER)[k];
    }
    set(&rx_head, head);
    out_armed = false;
    receive_next();
}

// ---- what usb_control.c tells --------------------------------------------------------------------

void usb_data_line_state(bool now_dtr)
{
    if (now_dtr != dtr) {
        // A new host must not get what the old one left; a packet that the old one no longer fetched may
        // still be with the controller, so a delimiter comes before the first frame.
        set(&tx_tail, get(&tx_head));
        delimiter_due = now_dtr;
    }
    dtr = now_dtr;
    touched = touched || (!dtr && line_rate == TOUCH_BITS_PER_S);
    send_next();
}

void usb_data_line_rate(uint32_t bits_per_s)
{
    line_rate = bits_per_s;
}

void usb_data_configure(bool now_configured)
{
    dtr = false;
    configured = now_configured;
    USB_BUFFER_IN(USB_EP_DATA) = 0;
    USB_BUFFER_OUT(USB_EP_DATA) = 0;
    in_busy = out_armed = last_was_full = false;
    in_toggle = out_toggle = 0;
    receive_next();
}

void usb_data_reset_toggle(uint8_t endpoint_address)
{
    if (endpoint_address == (0x80 | USB_EP_DATA)) {
        USB_BUFFER_IN(USB_EP_DATA) = 0; // a packet under way is lost, as the standard has it
        in_busy = false;
        in_toggle = 0;
        send_next();
    } else if (endpoint_address == USB_EP_DATA) {
        USB_BUFFER_OUT(USB_EP_DATA) = 0;
        out_armed = false;
        out_toggle = 0;
        receive_next();
    }
}

// ---- the controller ------------------------------------------------------------------------------

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
        in_busy = false;
        send_next();
    }
    if (done & DATA_OUT) {
        received();
    }
}

void usb_interrupt(void)
{
    uint32_t status = USB_INTS;
    // Buffers before SETUP: they belong to the request before it.
    if (status & USB_INT_BUFF_STATUS) {
        buffers_done();
    }
    if (status & USB_INT_SETUP_REQ) {
        suspended = false;
        usb_control_setup();
    }
    if (status & USB_INT_BUS_RESET) {
        USB_SIE_STATUS = USB_SIE_BUS_RESET; // writing 1 clears, here and below
        suspended = false;
        usb_control_bus_reset();
    }
    if (status & USB_INT_SUSPEND) {
        USB_SIE_STATUS = USB_SIE_SUSPENDED;
        suspended = true; // asleep, or the cable is out while something else powers the board
    }
    if (status & USB_INT_RESUME) {
        USB_SIE_STATUS = USB_SIE_RESUME;
        suspended = false;
    }
    timer_wake();
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
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_INTERRUPT | NOTIFY_BUFFER;
    USB_EP_IN_CONTROL(USB_EP_DATA) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_BULK | DATA_IN_BUFFER;
    USB_EP_OUT_CONTROL(USB_EP_DATA) =
        USB_EP_ENABLE | USB_EP_INT_PER_BUFFER | USB_EP_TYPE_BULK | DATA_OUT_BUFFER;
    USB_SIE_CTRL = USB_SIE_EP0_INT_1BUF;
    USB_INTE = USB_INT_BUFF_STATUS | USB_INT_SETUP_REQ | USB_INT_BUS_RESET | USB_INT_SUSPEND | USB_INT_RESUME;
    NVIC_IPR1 = 3u << 14; // interrupt 5 at the lowest priority: sampling goes first
    NVIC_ISER = 1u << USBCTRL_IRQ;
    USB_MAIN_CTRL = USB_CONTROLLER_EN;
    REG_SET(USB_SIE_CTRL) = USB_SIE_PULLUP_EN; // now the host sees a device
}

void usb_watch(void)
{
    static uint32_t frame, since_us;
    static bool off;
    uint32_t now_us = port_now_us();
    if (off) {
        if (now_us - since_us >= OFF_THE_BUS_US) {
            off = false;
            usb_start(serial_number);
        }
        return;
    }
    if (!in_busy || suspended || frame != USB_SOF_RD) {
        frame = USB_SOF_RD;
        since_us = now_us;
    } else if (now_us - since_us >= HEARS_NOTHING_US) {
        NVIC_ICER = 1u << USBCTRL_IRQ;
        usb_control_bus_reset();
        (void)take_out_of_reset(RESETS_USBCTRL);
        off = true;
        since_us = now_us;
    }
}

bool usb_all_sent(void)
{
    return !in_busy && get(&tx_head) == get(&tx_tail);
}

bool usb_touched(void)
{
    return touched;
}

// ---- link.c, main loop ----------------------------------------------------------------------------

// The main loop's turn at what the interrupt does: only this interrupt is held off, sampling is not.
static void hold_off(void)
{
    interrupt_hold_off(USBCTRL_IRQ);
}

static void let_go(void)
{
    interrupt_let_go(USBCTRL_IRQ);
}

bool usb_link_up(void)
{
    return link_open() && !suspended;
}

bool usb_link_write(const uint8_t *data, size_t bytes)
{
    uint32_t head = get(&tx_head);
    if (!usb_link_up() || bytes > TX_RING - (head - get(&tx_tail))) {
        return false;
    }
    dma_copy_to_ring(DMA_OF_FRAMES, tx, TX_RING, head, data, (uint32_t)bytes);
    set(&tx_head, head + (uint32_t)bytes);
    // The interrupt either sees the new bytes, or has left in_busy false by now; likewise when reading.
    atomic_signal_fence(memory_order_seq_cst);
    if (!in_busy) {
        hold_off();
        send_next();
        let_go();
    }
    return true;
}

size_t usb_link_read(uint8_t *data, size_t bytes)
{
    uint32_t tail = get(&rx_tail);
    uint32_t come = get(&rx_head) - tail;
    size_t taken = come < bytes ? come : bytes;
    for (size_t k = 0; k < taken; k++) {
        data[k] = rx[tail++ % RX_RING];
    }
    set(&rx_tail, tail);
    atomic_signal_fence(memory_order_seq_cst);
    if (taken > 0 && !out_armed) {
        hold_off();
        receive_next();
        let_go();
    }
    return taken;
}
