// A controller without an operating system that reads a gateway over a UART: the interrupt's part, and the
// main loop. The three functions of the chip are declared; firmware/port/stm32f405/uart.c shows how to define
// them. The two after them are the controller's: host/docs/guides/examples/grip.c is one.
#include "biotac_client.h"
#include <string.h>

// Puts bytes into the UART's transmit ring. Whole commands, or the board refuses the part that it got.
void uart_send(const uint8_t *data, size_t bytes);

// The next byte that the receive interrupt has put into the ring; -1 when there is none.
int uart_next(void);

uint32_t now_ms(void);

// Each round of each finger, once, as it comes; none when there is none. The force may be invalid: test it.
void act_on(const bt_msg_frame *frame);
void act_on_event(const bt_msg_event *event);

#define KEEPALIVE_MS 500 // the board stops streaming when it has heard nothing for so long
#define PING_MS      150
#define MAX_FINGERS  5
#define NONCE        7

static bt_client board;
static bt_client_rounds rounds[MAX_FINGERS];
static uint32_t lost;    // rounds, on the link
static uint32_t ping_ms; // when the board last heard from here
static uint32_t rx_ms;   // and when it last told of a finger
static uint8_t streaming;
static uint8_t unsubscribed; // a FRAME says that no EVENTS are
static bt_msg_subscribe wanted = {4, 0, BT_QUANTITY_FLAGS};

void hand_send(uint8_t id, const void *msg)
{
    uint8_t out[BT_ENCODED_MAX_BYTES];
    uart_send(out, bt_client_write(id, msg, out));
    ping_ms = now_ms();
}

static void dispatch(int id)
{
    if (id == BT_FRAME_ID || id == BT_IDLE_ID) {
        rx_ms = now_ms();
    }
    bt_msg_hello hello;
    bt_msg_event event;
    bt_msg_frame frame;
    bt_msg_idle idle;
    if (id == BT_HELLO_ID && bt_client_read(&board, BT_HELLO_ID, &hello) && hello.wire_major == BT_WIRE_MAJOR
        && hello.nonce == NONCE) {
        bt_msg_start start = {2, BT_STREAM_FLAG_FRAMES, 0, KEEPALIVE_MS};
        start.fingers = (uint8_t)((1u << (hello.fingers < MAX_FINGERS ? hello.fingers : MAX_FINGERS)) - 1u);
        wanted.fingers = start.fingers;
        board.accept_longer = hello.wire_minor > BT_WIRE_MINOR;
        memset(rounds, 0, sizeof rounds); // a board that restarted counts anew
        hand_send(BT_SUBSCRIBE_ID, &wanted);
        hand_send(BT_START_ID, &start);
        rx_ms = now_ms();
        streaming = 1;
    } else if (id == BT_IDLE_ID && bt_client_read(&board, BT_IDLE_ID, &idle) && idle.finger < MAX_FINGERS) {
        lost += bt_client_lost(&rounds[idle.finger], idle.seq, idle.frames);
    } else if (id == BT_FRAME_ID && bt_client_read(&board, BT_FRAME_ID, &frame)
               && frame.finger < MAX_FINGERS) {
        lost += bt_client_lost(&rounds[frame.finger], frame.seq, 1);
        unsubscribed = frame.slip_level == 255;
        act_on(&frame);
    } else if (id == BT_EVENT_ID && bt_client_read(&board, BT_EVENT_ID, &event)) {
        act_on_event(&event);
    }
}

// Call from the main loop, often. A board that has restarted sends nothing until it is asked again.
void hand_poll(void)
{
    int byte;
    while ((byte = uart_next()) >= 0) {
        dispatch(bt_client_push(&board, (uint8_t)byte));
    }
    if (now_ms() - rx_ms > KEEPALIVE_MS) {
        streaming = 0;
    }
    if (now_ms() - ping_ms >= PING_MS) {
        const bt_msg_hello_request hello = {1, NONCE};
        const bt_msg_ping ping = {3};
        if (!streaming) {
            hand_send(BT_HELLO_REQUEST_ID, &hello);
        } else if (unsubscribed) { // it was lost or damaged on the way: without it no slip is told
            hand_send(BT_SUBSCRIBE_ID, &wanted);
        } else {
            hand_send(BT_PING_ID, &ping);
        }
    }
}

uint32_t hand_lost(void)
{
    return lost;
}
