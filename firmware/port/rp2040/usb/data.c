// The serial port's data. Interrupts move packets; between them and the main loop stand two rings, each with
// one writer and one reader.
#include "usb/data.h"

#include "dma.h"
#include "rp2040_regs.h"
#include "system.h"
#include "usb/buffers.h"
#include "usb/descriptors.h"

RING(tx, 4096); // 40 ms of five fingers' frames
RING(rx, 256);  // some commands; when it is full the host is told to wait

#define TOUCH_BITS_PER_S 1200

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
    uint32_t tail = ring_get(&tx.tail);
    uint32_t waiting = ring_filled(&tx);
    uint32_t bytes = 0;
    if (delimiter_due) {
        out[bytes++] = 0;
        delimiter_due = false;
    }
    uint32_t taken = min(waiting, USB_PACKET_BYTES - bytes);
    uint32_t first = ring_run(&tx, tail, taken);
    dma_copy(DMA_OF_USB, out + bytes, ring_at(&tx, tail), first);
    dma_copy(DMA_OF_USB, out + bytes + first, tx.bytes, taken - first);
    bytes += taken;
    tail += taken;
    // A host waits for more after a full packet; when there is none, an empty one tells it so.
    if (bytes == 0 && !last_was_full) {
        return;
    }
    ring_set(&tx.tail, tail);
    last_was_full = bytes == USB_PACKET_BYTES;
    in_busy = true;
    usb_hand_over(&USB_BUFFER_IN(USB_EP_DATA), bytes | USB_BUFFER_FULL | in_toggle);
    in_toggle ^= USB_BUFFER_DATA1;
}

static void receive_next(void)
{
    if (out_armed || !configured || ring_room(&rx) < USB_PACKET_BYTES) {
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
        ring_forget(&tx);
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
    for (uint32_t k = 0; k < min(bytes, USB_PACKET_BYTES); k++) {
        uint8_t byte = usb_memory(USB_DATA_OUT_BUFFER)[k];
        (void)ring_put(&rx, &byte, 1); // there is room, or it would not have been armed
    }
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
    return !in_busy && ring_filled(&tx) == 0;
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
    if (!usb_link_up() || !dma_put(DMA_OF_FRAMES, &tx, data, (uint32_t)bytes)) {
        return false;
    }
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
    size_t taken = ring_take(&rx, data, bytes);
    atomic_signal_fence(memory_order_seq_cst);
    if (taken > 0 && !out_armed) {
        interrupt_hold_off(USBCTRL_IRQ);
        receive_next();
        interrupt_let_go(USBCTRL_IRQ);
    }
    return taken;
}
