#include "wire/crc32.h"

#include "wire/little_endian.h"

static uint32_t bytewise(uint32_t crc, const uint8_t *at, const uint8_t *end)
{
    for (; at != end; at++) {
        crc = bt_crc32_step(crc, *at);
    }
    return crc;
}

// A word at a time: a core without caches saves a third of the cycles per byte.
uint32_t bt_crc32(const uint8_t *data, size_t bytes)
{
    const size_t before = -(uintptr_t)data & 3;
    const uint8_t *const end = data + bytes;
    const uint8_t *at = before < bytes ? data + before : end;
    uint32_t crc = bytewise(BT_CRC32_START, data, at);
    for (const uint8_t *whole = at + ((size_t)(end - at) & ~(size_t)3); at != whole; at += 4) {
        crc ^= bt_get_aligned_u32(at);
        crc = bt_crc32_step(crc, 0);
        crc = bt_crc32_step(crc, 0);
        crc = bt_crc32_step(crc, 0);
        crc = bt_crc32_step(crc, 0);
    }
    return bt_crc32_end(bytewise(crc, at, end));
}
