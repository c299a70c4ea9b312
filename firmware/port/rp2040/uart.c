// A UART for a hand's own controller. Nothing tells who listens and nobody is made to wait: what finds no
// room in the ring is dropped by whole frames, as on USB, and what comes too fast is found by its CRC. The
// DMA sends, the main loop gives it a run of the ring at a time; an interrupt takes in what comes.
#include "dma.h"
#include "ring.h"
#include "rp2040_regs.h"
#include "system.h"
#include "wait.h"

#include "wire/messages_gen.h"

RING(tx, 2048);        // 20 ms of five fingers' frames
RING(rx, 256);         // some commands
static uint32_t given; // of tx, to the DMA
static bool started;
static uint32_t number; // of the chip's two

static void uart_interrupt(void)
{
    for (int k = 0; k < UART_FIFO_BYTES; k++) {
        if (UART_FR(number) & UART_FR_RXFE) {
            break;
        }
        uint8_t byte = (uint8_t)UART_DR(number); // a damaged one, too: the CRC judges
        (void)ring_put(&rx, &byte, 1);
    }
    UART_ICR(number) = UART_INT_RX | UART_INT_RT;
    wake();
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
    use_interrupt((int)UART_IRQ(number), 3, uart_interrupt); // sampling goes first
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
    const uint32_t tail = ring_get(&tx.tail) + given;
    ring_set(&tx.tail, tail);
    given = ring_run(&tx, tail, ring_filled(&tx));
    if (given > 0) {
        DMA_READ_ADDR(DMA_OF_UART) = dma_address(ring_at(&tx, tail));
        DMA_WRITE_ADDR(DMA_OF_UART) = dma_address(&UART_DR(number));
        DMA_TRANS_COUNT(DMA_OF_UART) = given;
        __asm volatile("" ::: "memory"); // what the DMA reads is written
        DMA_CTRL_TRIG(DMA_OF_UART) = DMA_QUIET | DMA_BY_UART_TX(number) | DMA_CHAIN_TO_ITSELF(DMA_OF_UART)
                                     | DMA_INCR_READ | DMA_CHANNEL_EN;
    }
}

bool uart_write(const uint8_t *data, size_t bytes)
{
    uart_watch();
    bool room = dma_put(DMA_OF_FRAMES, &tx, data, (uint32_t)bytes);
    uart_watch();
    return room;
}

bool uart_all_sent(void)
{
    return !started || (ring_filled(&tx) == 0 && !(UART_FR(number) & UART_FR_BUSY));
}

size_t uart_read(uint8_t *data, size_t bytes)
{
    return ring_take(&rx, data, bytes);
}

void uart_forget_heard(void)
{
    ring_forget(&rx);
}
