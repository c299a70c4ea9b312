// The owners of the DMA channels.
#ifndef BIOTAC_RP2_DMA_H
#define BIOTAC_RP2_DMA_H

#include <stdint.h>

enum dma_channel {
    DMA_DEALER, // slot.c
    DMA_WORKER,
    DMA_UART_TX,
};

// An address for the DMA's registers.
static inline uint32_t dma_address(const volatile void *at)
{
    return (uint32_t)(uintptr_t)at;
}

#endif
