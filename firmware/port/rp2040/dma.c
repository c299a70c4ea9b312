#include "dma.h"

#include "wait.h"

#define WAIT_DMA_TURNS 300u // of six cycles; a frame takes 254 at most, and some more when the bus is busy

bool dma_move(enum dma_channel channel, uint32_t options, volatile void *to, const void *from, uint32_t bytes)
{
    DMA_READ_ADDR(channel) = dma_address(from);
    DMA_WRITE_ADDR(channel) = dma_address(to);
    DMA_TRANS_COUNT(channel) = bytes;
    __asm volatile("" ::: "memory"); // what the DMA reads is written
    DMA_CTRL_TRIG(channel) =
        options | DMA_QUIET | DMA_UNPACED | DMA_CHAIN_TO_ITSELF(channel) | DMA_INCR_READ | DMA_CHANNEL_EN;
    if (!wait_for(&DMA_CTRL_TRIG(channel), DMA_BUSY, 0, WAIT_DMA_TURNS)) {
        DMA_CHAN_ABORT = 1u << channel;
        (void)wait_for(&DMA_CHAN_ABORT, 1u << channel, 0, WAIT_DMA_TURNS);
        return false;
    }
    __asm volatile("" ::: "memory");
    return true;
}

void dma_copy(enum dma_channel channel, volatile uint8_t *to, const uint8_t *from, uint32_t bytes)
{
    if (bytes == 0 || dma_move(channel, DMA_INCR_WRITE, to, from, bytes)) {
        return;
    }
    for (uint32_t k = 0; k < bytes; k++) {
        to[k] = from[k];
    }
}
