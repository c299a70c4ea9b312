// CRC-32 (IEEE 802.3, zlib): reflected 0xEDB88320, start and final XOR 0xFFFFFFFF.
// Check value: "123456789" gives 0xCBF43926.
#ifndef BIOTAC_CRC32_H
#define BIOTAC_CRC32_H

#include <stddef.h>
#include <stdint.h>

extern const uint32_t bt_crc32_table[256];

uint32_t bt_crc32(const uint8_t *data, size_t bytes);

// The same for outgoing frames; a board's build may define it to use hardware.
#ifndef BT_CRC32
#define BT_CRC32(data, bytes) bt_crc32(data, bytes)
#endif

// The same byte by byte, for code that handles each byte anyway: start, a step for each, end.
#define BT_CRC32_START 0xFFFFFFFFu
#ifndef BT_CDEF
static inline uint32_t bt_crc32_step(uint32_t crc, uint8_t byte)
{
    return crc >> 8 ^ bt_crc32_table[(crc ^ byte) & 0xFF];
}

static inline uint32_t bt_crc32_end(uint32_t crc)
{
    return ~crc;
}
#endif

#endif
