// The serial port's data. Interrupts move packets; between them and the main loop stand two rings, each with
// one writer and one reader.
#include "usb/data.h"

#include "dma.h"
#include "rp2040_regs.h"
#include "system.h"
#include "usb/buffers.h"
#include "usb/descriptors.h"

#include <stdatomic.h>

#define TX_RING 4096 // 40 ms of five fingers' frames
#define RX_RING 256  // some commands; when it is full the host is told to wait
_Static_assert((TX_RING & (TX_RING - 1)) == 0 && (RX_RING & (RX_RING - 1)) == 0, "indices wrap");

#define TOUCH_BITS_PER_S 1200

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
    volatile uint8_t *out = usb_memory(USB_DATA_IN_BUFFER);
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

// ---- what endpoint 0 and the controller tell -------------------------------------------------------

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

void usb_data_suspend(bool now_suspended)
{
    suspended = now_suspended;
}

void usb_data_sent(void)
{
    in_busy = false;
    send_next();
}

void usb_data_received(void)
{
    uint32_t bytes = USB_BUFFER_OUT(USB_EP_DATA) & USB_BUFFER_LENGTH;
    uint32_t head = get(&rx_head);
    bytes = bytes < USB_PACKET_BYTES ? bytes : USB_PACKET_BYTES;
    for (uint32_t k = 0; k < bytes; k++) {
        rx[head++ % RX_RING] = usb_memory(USB_DATA_OUT_BUFFER)[k];
    }
    set(&rx_head, head);
    out_armed = false;
    receive_next();
}

bool usb_data_waits(void)
{
    return in_busy && !suspended;
}

// ---- main loop -------------------------------------------------------------------------------------------

bool usb_all_sent(void)
{
    return !in_busy && get(&tx_head) == get(&tx_tail);
}

bool usb_touched(void)
{
    return touched;
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
        interrupt_hold_off(USBCTRL_IRQ); // and no other: sampling goes on
        send_next();
        interrupt_let_go(USBCTRL_IRQ);
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
        interrupt_hold_off(USBCTRL_IRQ);
        receive_next();
        interrupt_let_go(USBCTRL_IRQ);
    }
    return taken;
}
