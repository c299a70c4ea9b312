#include "sniffer.h"

#include "wait.h"

uint32_t bt_crc32(const uint8_t *data, size_t bytes); // core/wire/crc32.h: what this stands in for

#define WAIT_DMA_TURNS 300u // of six cycles; a frame takes 254 at most, and some more when the bus is busy

uint32_t rp2040_crc32(const uint8_t *data, size_t bytes)
{
    static volatile uint8_t nowhere;
    DMA_SNIFF_CTRL = DMA_SNIFF_OUT_INV | DMA_SNIFF_OUT_REV | DMA_SNIFF_CALC_CRC32_REVERSED
                     | DMA_SNIFF_CHANNEL_0 | DMA_SNIFF_EN;
    DMA_SNIFF_DATA = 0xFFFFFFFFu;
    DMA_READ_ADDR(0) = (uint32_t)(uintptr_t)data;
    DMA_WRITE_ADDR(0) = (uint32_t)(uintptr_t)&nowhere;
    DMA_TRANS_COUNT(0) = (uint32_t)bytes;
    __asm volatile("" ::: "memory"); // what the DMA reads is written
    DMA_CTRL_TRIG(0) =
        DMA_SNIFF_THIS | DMA_QUIET | DMA_UNPACED | DMA_CHAIN_TO_ITSELF(0) | DMA_INCR_READ | DMA_CHANNEL_EN;
    if (!wait_for(&DMA_CTRL_TRIG(0), DMA_BUSY, 0, WAIT_DMA_TURNS)) {
        DMA_CHAN_ABORT = 1u << 0;
        return bt_crc32(data, bytes);
    }
    return DMA_SNIFF_DATA;
}
