#include "sniffer.h"

#include "dma.h"
#include "rp2040_regs.h"

uint32_t bt_crc32(const uint8_t *data, size_t bytes); // core/wire/crc32.h: what this stands in for

uint32_t rp2040_crc32(const uint8_t *data, size_t bytes)
{
    static volatile uint8_t nowhere;
    DMA_SNIFF_CTRL = DMA_SNIFF_OUT_INV | DMA_SNIFF_OUT_REV | DMA_SNIFF_CALC_CRC32_REVERSED
                     | DMA_SNIFF_CHANNEL(DMA_OF_FRAMES) | DMA_SNIFF_EN;
    DMA_SNIFF_DATA = 0xFFFFFFFFu;
    if (!dma_move(DMA_OF_FRAMES, DMA_SNIFF_THIS, &nowhere, data, (uint32_t)bytes)) {
        return bt_crc32(data, bytes);
    }
    return DMA_SNIFF_DATA;
}
