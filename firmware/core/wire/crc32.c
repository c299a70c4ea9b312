#include "wire/crc32.h"

uint32_t bt_crc32(const uint8_t *data, size_t bytes)
{
    uint32_t crc = BT_CRC32_START;
    for (size_t k = 0; k < bytes; k++) {
        crc = bt_crc32_step(crc, data[k]);
    }
    return bt_crc32_end(crc);
}
