#include "decode/crc_fast.h"

#include "wire/crc32.h"
#include "wire/little_endian.h"

void bt_crc_fast_set_up(bt_crc_fast *fast)
{
    for (uint32_t byte = 0; byte < 256; byte++) {
        uint32_t crc = byte;
        for (int k = 0; k < BT_CRC_SLICES; k++) {
            crc = bt_crc32_step(crc, 0);
            fast->slices[k][byte] = crc;
        }
    }
}

uint32_t bt_crc_fast_compute(const bt_crc_fast *fast, const uint8_t *data, size_t bytes)
{
    const uint32_t (*slices)[256] = (const uint32_t (*)[256])fast->slices;
    uint32_t crc = BT_CRC32_START;
    for (; bytes >= BT_CRC_SLICES; data += BT_CRC_SLICES, bytes -= BT_CRC_SLICES) {
        uint32_t low = crc ^ bt_get_u32(data);
        uint32_t high = bt_get_u32(data + 4);
        crc = slices[7][low & 0xFF] ^ slices[6][low >> 8 & 0xFF] ^ slices[5][low >> 16 & 0xFF]
              ^ slices[4][low >> 24] ^ slices[3][high & 0xFF] ^ slices[2][high >> 8 & 0xFF]
              ^ slices[1][high >> 16 & 0xFF] ^ slices[0][high >> 24];
    }
    for (size_t k = 0; k < bytes; k++) {
        crc = bt_crc32_step(crc, data[k]);
    }
    return bt_crc32_end(crc);
}
