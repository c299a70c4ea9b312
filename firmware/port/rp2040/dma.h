// Bytes moved by the DMA, one a cycle, where the core takes eight; and who has which channel.
#ifndef BIOTAC_RP2040_DMA_H
#define BIOTAC_RP2040_DMA_H

#include "ring.h"

#include <stdbool.h>
#include <stdint.h>

enum dma_channel {
    DMA_OF_FRAMES, // main loop; the sniffer's, too
    DMA_DEALER,    // slot.c
    DMA_WORKER,
    DMA_OF_USB, // the USB's interrupt, or with it held off
    DMA_OF_UART,
};

// An address as the DMA's registers take it.
static inline uint32_t dma_address(const volatile void *at)
{
    return (uint32_t)(uintptr_t)at;
}

// Waits until they are moved, at most 254. More of the channel's control bits than every move has go into
// options. False when the DMA came to no end and was stopped: what it moved is then unknown.
bool dma_move(enum dma_channel channel, uint32_t options, volatile void *to, const void *from,
              uint32_t bytes);

// The same, by the core should the DMA not come to an end.
void dma_copy(enum dma_channel channel, volatile uint8_t *to, const uint8_t *from, uint32_t bytes);

// ring_put by the DMA.
static inline bool dma_put(enum dma_channel channel, ring *to, const uint8_t *from, uint32_t bytes)
{
    const uint32_t head = ring_get(&to->head);
    const uint32_t first = ring_run(to, head, bytes);
    if (bytes > ring_room(to)) {
        return false;
    }
    dma_copy(channel, ring_at(to, head), from, first);
    dma_copy(channel, to->bytes, from + first, bytes - first);
    ring_set(&to->head, head + bytes);
    return true;
}

#endif
