// The only link: USART3. The board cannot know if anyone listens: frames without room in the ring are dropped
// whole, and received bytes that are lost show as a wrong CRC. Without a FIFO, at 921 600 bit/s a byte must
// be read within 10.8 us, so this interrupt goes before the sampler's.
#include "only_board.h"

#include "pins.h"
#include "ring.h"
#include "stm32f405.h"

#define DEFAULT_BITS_PER_S 921600u // this board has no other link, so "none" cannot be meant

RING(tx, 4096); // 40 ms of five fingers' frames
RING(rx, 512);  // some commands
static bool started;
volatile bool uart_received;

// In the interrupt, or with it held off. Silicon sends a byte at a time; QEMU's UART is always ready and
// never interrupts.
static void send(void)
{
    uint8_t byte = 0;
    for (uint32_t k = ring_filled(&tx); k != 0; k--) {
        if (!(USART3_SR & USART_SR_TXE)) {
            break;
        }
        (void)ring_pop(&tx, &byte, 1);
        USART3_DR = byte;
    }
    if (ring_filled(&tx) != 0) {
        USART3_CR1 |= USART_CR1_TXEIE;
    } else {
        USART3_CR1 &= ~USART_CR1_TXEIE;
    }
}

static void uart_interrupt(void)
{
    if (USART3_SR & (USART_SR_RXNE | USART_SR_ORE)) {
        uint8_t byte = (uint8_t)USART3_DR; // a damaged one too: the CRC decides
        (void)ring_put(&rx, &byte, 1);
        uart_received = true;
        wake();
    }
    send();
}

void uart_poll(void)
{
    if (started && ring_filled(&tx) != 0) {
        interrupt_hold_off(USART3_IRQ);
        send();
        interrupt_enable(USART3_IRQ);
    }
}

void port_link_uart(bt_port *port, uint32_t bits_per_s)
{
    bits_per_s = bits_per_s == 0 ? DEFAULT_BITS_PER_S : bits_per_s;
    pin_function(PORT_UART, PIN_UART_TX, UART_FUNCTION, PULL_NONE);
    pin_function(PORT_UART, PIN_UART_RX, UART_FUNCTION, PULL_UP); // an undriven line is idle
    USART3_CR1 = 0;
    const uint32_t clocks = (APB1_HZ + bits_per_s / 2) / bits_per_s; // of a bit; fewer than 16 need OVER8
    USART3_BRR = clocks < 16 ? clocks / 8 << 4 | clocks % 8 : clocks;
    USART3_CR1 =
        (clocks < 16 ? USART_CR1_OVER8 : 0) | USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE;
    use_interrupt(USART3_IRQ, 0, uart_interrupt);
    started = true;
}

uint32_t port_link_turns(bt_port *port, unsigned link)
{
    return link == 0 && started; // open for good
}

bool port_link_touched(bt_port *port)
{
    return false;
}

bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes)
{
    bool room = link == 0 && ring_put(&tx, data, bytes);
    uart_poll();
    return room;
}

size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes)
{
    return link == 0 ? ring_pop(&rx, data, bytes) : 0;
}

bool uart_all_sent(void)
{
    return ring_filled(&tx) == 0 && USART3_SR & USART_SR_TC;
}
