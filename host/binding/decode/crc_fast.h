// CRC-32 of whole messages, for the host's decoder, which spends most of its time on it: bt_crc32() in steps
// of eight bytes by table.
#ifndef BIOTAC_CRC_FAST_H
#define BIOTAC_CRC_FAST_H

#include <stddef.h>
#include <stdint.h>

#define BT_CRC_SLICES 8

typedef struct {
    uint32_t slices[BT_CRC_SLICES][256]; // k: effect of a byte on the CRC after k more zeros
} bt_crc_fast;

void bt_crc_fast_set_up(bt_crc_fast *crc);

uint32_t bt_crc_fast_compute(const bt_crc_fast *crc, const uint8_t *data, size_t bytes);

#endif
