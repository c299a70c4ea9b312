// CRC-32 (IEEE 802.3, zlib): reflected 0xEDB88320, start and final XOR 0xFFFFFFFF.
// Check value: "123456789" gives 0xCBF43926.
#ifndef BIOTAC_CRC32_H
#define BIOTAC_CRC32_H

#include <stddef.h>
#include <stdint.h>

uint32_t bt_crc32(const uint8_t *data, size_t bytes);

#endif
