// Wrench maps to move about: each is one the firmware takes, and tells which it is by its bytes.
#ifndef BIOTAC_TEST_MAP_BLOB_H
#define BIOTAC_TEST_MAP_BLOB_H

#include "map/map.h"
#include "wire/crc32.h"
#include "wire/little_endian.h"

#include <string.h>

// blocks: the first one is an offset, every later one 19 signals times a gate, at most 7 of both. serial: of
// the sensor; "" for any. Returns its size.
static inline size_t make_map(uint8_t *blob, uint32_t number, int blocks, const char *serial)
{
    size_t at = BT_MAP_HEADER_BYTES;
    int coefficients = 3 * (1 + 19 * (blocks - 1));
    memset(blob, 0, BT_MAP_MAX_BYTES);
    blob[0] = BT_MAP_VERSION;
    blob[1] = 3;
    blob[2] = (uint8_t)blocks;
    memcpy(blob + 4, serial, strlen(serial));
    bt_put_u32(blob + 20, number);
    for (int k = 0; k < blocks; k++, at += BT_MAP_BLOCK_BYTES) {
        blob[at] = k == 0 ? BT_MAP_KIND_OFFSET : BT_MAP_KIND_SIGNAL;
        blob[at + 1] = (uint8_t)(k == 0 ? BT_MAP_GATE_ONE : k - 1);
    }
    for (int k = 0; k < coefficients; k++, at += 4) {
        bt_put_u32(blob + at, (number * 2654435761u + (uint32_t)k * 40503u) & 0xFFFFFF);
    }
    return at;
}

// One of 6 axes that fills its room but for less than a row.
static inline size_t make_big_map(uint8_t *blob, uint32_t number)
{
    static const uint8_t kind[5] = {BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_KIND_SIGNAL_PAIRS,
                                    BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_KIND_SIGNAL};
    size_t at = BT_MAP_HEADER_BYTES;
    memset(blob, 0, BT_MAP_MAX_BYTES);
    blob[0] = BT_MAP_VERSION;
    blob[1] = 6;
    blob[2] = sizeof kind;
    bt_put_u32(blob + 20, number);
    for (size_t k = 0; k < sizeof kind; k++, at += BT_MAP_BLOCK_BYTES) {
        blob[at] = kind[k];
        blob[at + 1] = (uint8_t)k;
    }
    for (int k = 0; k < 6 * (4 * 190 + 19); k++, at += 4) {
        bt_put_u32(blob + at, (number * 2654435761u + (uint32_t)k * 40503u) & 0xFFFFFF);
    }
    return at;
}

#endif
