// A UART for a hand's own controller. Nothing tells who listens and nobody is made to wait: what finds no
// room in the ring is dropped by whole frames, as on USB, and what comes too fast is found by its CRC. The
// DMA sends, the main loop gives it a run of the ring at a time; an interrupt takes in what comes.
#include "dma.h"
#include "rp2040_regs.h"
#include "system.h"
#include "wait.h"

#include "wire/messages_gen.h"

#include <stdatomic.h>

#define TX_RING 2048 // 20 ms of five fingers' frames
#define RX_RING 256  // some commands
_Static_assert((TX_RING & (TX_RING - 1)) == 0 && (RX_RING & (RX_RING - 1)) == 0, "indices wrap");

static bool started;
static uint32_t number; // of the chip's two
static uint8_t tx[TX_RING];
static uint32_t tx_head, tx_tail; // count bytes ever put in and sent
static uint32_t tx_given;         // to the DMA, from tx_tail on
static uint8_t rx[RX_RING];
static _Atomic uint32_t rx_head; // interrupt
static _Atomic uint32_t rx_tail; // main loop

static void uart_interrupt(void)
{
    uint32_t head = atomic_load_explicit(&rx_head, memory_order_relaxed);
    const uint32_t tail = atomic_load_explicit(&rx_tail, memory_order_acquire);
    for (int k = 0; k < UART_FIFO_BYTES; k++) {
        if (UART_FR(number) & UART_FR_RXFE) {
            break;
        }
        uint8_t byte = (uint8_t)UART_DR(number); // a damaged one, too: the CRC judges
        if (head - tail < RX_RING) {
            rx[head++ % RX_RING] = byte;
        }
    }
    atomic_store_explicit(&rx_head, head, memory_order_release);
    UART_ICR(number) = UART_INT_RX | UART_INT_RT;
    timer_wake();
}

void uart_start(uint32_t bits_per_s, uint32_t pins)
{
    static const struct {
        uint8_t send, uart; // it hears on the next
    } of_pins[] = {
        [BT_UART_PINS_GPIO_0_1] = {0, 0},
        [BT_UART_PINS_GPIO_4_5] = {4, 1},
        [BT_UART_PINS_GPIO_8_9] = {8, 1},
        [BT_UART_PINS_GPIO_12_13] = {12, 0},
    };
    if (pins >= sizeof of_pins / sizeof *of_pins) {
        return;
    }
    const uint32_t send = of_pins[pins].send;
    const uint32_t hear = send + 1;
    number = of_pins[pins].uart;
    if (!take_out_of_reset(RESETS_UART(number))) {
        return;
    }
    const uint32_t divisor_q6 = (CLK_SYS_HZ / 16 * 64 + bits_per_s / 2) / bits_per_s;
    UART_IBRD(number) = divisor_q6 >> 6;
    UART_FBRD(number) = divisor_q6 & 63;
    UART_LCR_H(number) = UART_LCR_H_8_BITS | UART_LCR_H_FEN;
    UART_DMACR(number) = UART_DMACR_TXDMAE;
    UART_IMSC(number) = UART_INT_RX | UART_INT_RT;
    UART_CR(number) = UART_CR_RXE | UART_CR_TXE | UART_CR_UARTEN;
    PADS_BANK0_GPIO(send) = PADS_DRIVE_4MA | PADS_SCHMITT | PADS_IE;
    IO_BANK0_GPIO_CTRL(send) = GPIO_FUNC_UART;
    PADS_BANK0_GPIO(hear) = PADS_IE | PADS_SCHMITT | PADS_PUE; // a line that nobody drives is idle
    IO_BANK0_GPIO_CTRL(hear) = GPIO_FUNC_UART;
    use_interrupt(UART_IRQ(number), uart_interrupt);
    NVIC_IPR5 = 3u << 14 | 3u << 6; // both at the lowest priority: sampling goes first
    NVIC_ISER = 1u << UART_IRQ(number);
    started = true;
}

bool uart_started(void)
{
    return started;
}

void uart_watch(void)
{
    if (DMA_CTRL_TRIG(DMA_OF_UART) & DMA_BUSY) {
        return;
    }
    tx_tail += tx_given;
    const uint32_t waiting = tx_head - tx_tail;
    const uint32_t at_once = TX_RING - tx_tail % TX_RING; // the rest lies at the ring's start
    tx_given = waiting < at_once ? waiting : at_once;
    if (tx_given > 0) {
        DMA_READ_ADDR(DMA_OF_UART) = dma_address(tx + tx_tail % TX_RING);
        DMA_WRITE_ADDR(DMA_OF_UART) = dma_address(&UART_DR(number));
        DMA_TRANS_COUNT(DMA_OF_UART) = tx_given;
        __asm volatile("" ::: "memory"); // what the DMA reads is written
        DMA_CTRL_TRIG(DMA_OF_UART) = DMA_QUIET | DMA_BY_UART_TX(number) | DMA_CHAIN_TO_ITSELF(DMA_OF_UART)
                                     | DMA_INCR_READ | DMA_CHANNEL_EN;
    }
}

bool uart_write(const uint8_t *data, size_t bytes)
{
    uart_watch();
    if (bytes > TX_RING - (tx_head - tx_tail)) {
        return false;
    }
    dma_copy_to_ring(DMA_OF_FRAMES, tx, TX_RING, tx_head, data, (uint32_t)bytes);
    tx_head += (uint32_t)bytes;
    uart_watch();
    return true;
}

bool uart_all_sent(void)
{
    return !started || (tx_head == tx_tail && !(UART_FR(number) & UART_FR_BUSY));
}

size_t uart_read(uint8_t *data, size_t bytes)
{
    uint32_t tail = atomic_load_explicit(&rx_tail, memory_order_relaxed);
    const uint32_t come = atomic_load_explicit(&rx_head, memory_order_acquire) - tail;
    const size_t taken = come < bytes ? come : bytes;
    for (size_t k = 0; k < taken; k++) {
        data[k] = rx[tail++ % RX_RING];
    }
    atomic_store_explicit(&rx_tail, tail, memory_order_release);
    return taken;
}

void uart_forget_heard(void)
{
    atomic_store_explicit(&rx_tail, atomic_load_explicit(&rx_head, memory_order_acquire),
                          memory_order_release);
}
