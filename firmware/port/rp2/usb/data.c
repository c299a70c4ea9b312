// The serial port's data. Interrupts move packets; two rings connect them to the main loop, each with one
// writer and one reader.
#include "usb/data.h"

#include "only_board.h"
#include "ring.h"
#include "rp2_regs.h"
#include "system.h"
#include "usb/buffers.h"
#include "usb/descriptors.h"

RING(tx, 4096); // 40 ms of five fingers' frames
RING(rx, 256);  // some commands; the controller holds the host off while it is full

#define TOUCH_BITS_PER_S 1200

static volatile bool configured;
static volatile bool suspended;
static volatile bool dtr;
static volatile bool touched;
static volatile uint32_t turns;     // port_link_turns
static volatile uint32_t turned_at; // rx.head then: older bytes are from another host
static uint32_t read_turns;         // the main loop's
static volatile uint32_t frame_us;  // when the latest frame of the bus began
static volatile bool in_busy;       // the controller holds a packet for the host
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

// RP2040-E15: a bulk IN that is armed at the end of a frame may hang the controller. From here on it waits
// for the next frame, also where there are none; the margin includes the delay of the start-of-frame
// interrupt.
#define FRAME_US          1000u
#define ARM_BEFORE_END    200u
#define INTERRUPT_LATE_US 60u // behind a slot's interrupt that asks sensors for serial numbers
static bool may_arm(void)
{
    return port_now_us(ONLY_BOARD) - frame_us < FRAME_US - ARM_BEFORE_END - INTERRUPT_LATE_US;
}

static void count_turn(void)
{
    if ((link_open() && !suspended) != (turns & 1)) {
        turned_at = ring_get(&rx.head);
        turns = turns + 1;
    }
}

static uint32_t min(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void send_next(void)
{
    if (in_busy || !link_open() || !may_arm()) {
        return;
    }
    volatile uint8_t *out = usb_memory(USB_DATA_IN_BUFFER);
    uint32_t tail = ring_get(&tx.tail);
    uint32_t bytes = 0;
    if (delimiter_due) {
        out[bytes++] = 0;
        delimiter_due = false;
    }
    const uint32_t count = min(ring_filled(&tx), USB_PACKET_BYTES - bytes);
    const uint32_t first = ring_run(&tx, tail, count);
    copy_bytes(out + bytes, ring_at(&tx, tail), first);
    copy_bytes(out + bytes + first, tx.bytes, count - first);
    bytes += count;
    tail += count;
    // A host expects more after a full packet; an empty one ends it.
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
        return; // not armed: the controller holds the host off
    }
    out_armed = true;
    usb_hand_over(&USB_BUFFER_OUT(USB_EP_DATA), USB_PACKET_BYTES | out_toggle);
    out_toggle ^= USB_BUFFER_DATA1;
}

// ---- reports of endpoint 0 and the controller ------------------------------------------------------

void usb_data_line_state(bool now_dtr)
{
    if (now_dtr != dtr) {
        // A new host must not get the old one's bytes. The controller may still hold a packet for the old
        // one, so a delimiter comes before the first frame.
        ring_forget(&tx);
        delimiter_due = now_dtr;
    }
    touched = touched || (dtr && !now_dtr && line_rate == TOUCH_BITS_PER_S);
    dtr = now_dtr;
    count_turn();
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
    count_turn();
    USB_BUFFER_IN(USB_EP_DATA) = 0;
    USB_BUFFER_OUT(USB_EP_DATA) = 0;
    in_busy = out_armed = last_was_full = false;
    in_toggle = out_toggle = 0;
    receive_next();
}

void usb_data_reset_toggle(uint8_t endpoint_address)
{
    if (endpoint_address == (0x80 | USB_EP_DATA)) {
        USB_BUFFER_IN(USB_EP_DATA) = 0; // a packet under way is lost, by the standard
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
    count_turn();
}

void usb_data_frame(void)
{
    frame_us = port_now_us(ONLY_BOARD);
    send_next();
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
        (void)ring_put(&rx, &byte, 1); // room was checked before arming
    }
    out_armed = false;
    receive_next();
}

bool usb_data_configured(void)
{
    return configured;
}

// ---- main loop -------------------------------------------------------------------------------------------

bool usb_all_sent(void)
{
    return !in_busy && ring_filled(&tx) == 0;
}

bool port_link_touched(bt_port *port)
{
    const bool was = touched;
    touched = false;
    return was;
}

uint32_t usb_turns(void)
{
    return turns;
}

bool usb_link_write(const uint8_t *data, size_t bytes)
{
    if (!(turns & 1) || !ring_put(&tx, data, bytes)) {
        return false;
    }
    // The interrupt either sees the new bytes, or has left in_busy false by now; likewise when reading.
    atomic_signal_fence(memory_order_seq_cst);
    if (!in_busy) {
        interrupt_hold_off(USBCTRL_IRQ); // and no other: sampling goes on
        send_next();
        interrupt_enable(USBCTRL_IRQ);
    }
    return true;
}

// Returns 0 first after the port was opened or closed: the reader has seen that change by the next call.
size_t usb_link_read(uint8_t *data, size_t bytes)
{
    const bool turned = turns != read_turns;
    size_t count = 0;
    if (turned) {
        read_turns = turns;
        ring_set(&rx.tail, turned_at);
    } else {
        count = ring_pop(&rx, data, bytes);
    }
    atomic_signal_fence(memory_order_seq_cst);
    if ((turned || count > 0) && !out_armed) {
        interrupt_hold_off(USBCTRL_IRQ);
        receive_next();
        interrupt_enable(USBCTRL_IRQ);
    }
    return count;
}
