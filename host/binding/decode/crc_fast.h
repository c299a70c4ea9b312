// CRC-32 of whole messages, for the host's decoder, which spends most of its time on it: bt_crc32() in steps
// of sixteen bytes by carry-less multiplication where the processor has that, else of eight bytes by table.
//
// Zeros in front change nothing in a CRC that starts at zero, so both fill up the first step with them; a
// start of all ones is the same as none and the first four bytes complemented.
#ifndef BIOTAC_CRC_FAST_H
#define BIOTAC_CRC_FAST_H

#include <stddef.h>
#include <stdint.h>

#define BT_CRC_SLICES      8
#define BT_CRC_PAD_BYTES   16 // zeros that must stand before the data
#define BT_CRC_LEAST_BYTES 4  // shorter data goes through bt_crc32()

typedef struct {
    uint8_t multiplies;                  // 1: this processor can, and does
    uint32_t slices[BT_CRC_SLICES][256]; // k: what a byte does to the CRC by the end of k more zeros
} bt_crc_fast;

void bt_crc_fast_set_up(bt_crc_fast *crc);

// data[-16] to data[-1] are zero; data may be written to, and is as before afterwards.
uint32_t bt_crc_fast_of(const bt_crc_fast *crc, uint8_t *data, size_t bytes);

#endif
