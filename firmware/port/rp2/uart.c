// A UART for a hand's own controller. The board cannot know if anyone listens, and never waits: frames
// without room in the ring are dropped whole, as on USB, and received bytes that are lost show as a wrong
// CRC. The DMA sends runs of the ring from the main loop; an interrupt receives.
#include "dma.h"
#include "ring.h"
#include "rp2_regs.h"
#include "system.h"
#include "wait.h"

// UART0; the sensors' wiring does not use these pins.
#define PIN_UART_TX 0
#define PIN_UART_RX 1

RING(tx, 2048);        // 20 ms of five fingers' frames
RING(rx, 256);         // some commands
static uint32_t given; // of tx, to the DMA
static bool started;

static void uart_interrupt(void)
{
    for (int k = 0; k < UART_FIFO_BYTES; k++) {
        if (UART_FR & UART_FR_RXFE) {
            break;
        }
        uint8_t byte = (uint8_t)UART_DR; // a damaged one too: the CRC decides
        (void)ring_put(&rx, &byte, 1);
    }
    UART_ICR = UART_INT_RX | UART_INT_RT;
    wake();
}

void uart_start(uint32_t bits_per_s)
{
    if (!reset_blocks(RESETS_UART0)) {
        return;
    }
    const uint32_t divisor_q6 = (CLK_SYS_HZ / 16 * 64 + bits_per_s / 2) / bits_per_s;
    UART_IBRD = divisor_q6 >> 6;
    UART_FBRD = divisor_q6 & 63;
    UART_LCR_H = UART_LCR_H_8_BITS | UART_LCR_H_FEN;
    UART_DMACR = UART_DMACR_TXDMAE;
    UART_IMSC = UART_INT_RX | UART_INT_RT;
    UART_CR = UART_CR_RXE | UART_CR_TXE | UART_CR_UARTEN;
    PADS_BANK0_GPIO(PIN_UART_TX) = PADS_DRIVE_4MA | PADS_SCHMITT | PADS_IE;
    IO_BANK0_GPIO_CTRL(PIN_UART_TX) = GPIO_FUNC_UART;
    PADS_BANK0_GPIO(PIN_UART_RX) = PADS_IE | PADS_SCHMITT | PADS_PUE; // an undriven line is idle
    IO_BANK0_GPIO_CTRL(PIN_UART_RX) = GPIO_FUNC_UART;
    use_interrupt(UART0_IRQ, 3, uart_interrupt); // sampling goes first
    started = true;
}

bool uart_started(void)
{
    return started;
}

void uart_poll(void)
{
    if (DMA_CTRL_TRIG(DMA_UART_TX) & DMA_BUSY) {
        return;
    }
    const uint32_t tail = ring_get(&tx.tail) + given;
    ring_set(&tx.tail, tail);
    given = ring_run(&tx, tail, ring_filled(&tx));
    if (given > 0) {
        DMA_READ_ADDR(DMA_UART_TX) = dma_address(ring_at(&tx, tail));
        DMA_WRITE_ADDR(DMA_UART_TX) = dma_address(&UART_DR);
        DMA_TRANS_COUNT(DMA_UART_TX) = given;
        __asm volatile("" ::: "memory"); // write all that the DMA reads
        DMA_CTRL_TRIG(DMA_UART_TX) =
            DMA_QUIET | DMA_BY_UART0_TX | DMA_CHAIN_TO_ITSELF(DMA_UART_TX) | DMA_INCR_READ | DMA_CHANNEL_EN;
    }
}

bool uart_write(const uint8_t *data, size_t bytes)
{
    uart_poll();
    bool room = ring_put(&tx, data, bytes);
    uart_poll();
    return room;
}

bool uart_all_sent(void)
{
    return !started || (ring_filled(&tx) == 0 && !(UART_FR & UART_FR_BUSY));
}

size_t uart_read(uint8_t *data, size_t bytes)
{
    return !started ? 0 : ring_pop(&rx, data, bytes);
}
