// The DMA's CRC of what it moves (data sheet 2.5.5), for BT_CRC32: a byte a cycle, where a table takes ten.
#ifndef BIOTAC_RP2040_SNIFFER_H
#define BIOTAC_RP2040_SNIFFER_H

#include <stddef.h>
#include <stdint.h>

// The same as bt_crc32, which it calls should the DMA not come to an end. Not for interrupt handlers.
uint32_t rp2040_crc32(const uint8_t *data, size_t bytes);

#define BT_CRC32(data, bytes) rp2040_crc32(data, bytes)

#endif
