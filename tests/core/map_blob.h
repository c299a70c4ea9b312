// Wrench maps to move about: the firmware takes each, and the bytes tell which one it is.
#ifndef BIOTAC_TEST_MAP_BLOB_H
#define BIOTAC_TEST_MAP_BLOB_H

#include "map/map.h"
#include "wire/crc32.h"
#include "wire/little_endian.h"

#include <string.h>

// A head, blocks of these kinds and gates, coefficients by a number; the last column behind 19 or one is 0.
// Returns the map's size.
static inline size_t put_map(uint8_t *blob, uint32_t number, uint8_t axes, const uint8_t (*blocks)[2],
                             int count)
{
    static const uint8_t columns[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS,
                         coefficients[BT_MAP_KINDS] = BT_MAP_KIND_COEFFICIENTS;
    size_t at = BT_MAP_HEADER_BYTES;
    uint32_t step = 0;
    memset(blob, 0, BT_MAP_MAX_BYTES);
    blob[0] = BT_MAP_VERSION;
    blob[1] = axes;
    blob[2] = (uint8_t)count;
    bt_put_u32(blob + 20, number);
    for (int k = 0; k < count; k++, at += BT_MAP_BLOCK_BYTES) {
        memcpy(blob + at, blocks[k], 2);
        memset(blob + at + 2, 8, axes);
    }
    for (int k = 0; k < count; k++) {
        for (int group = 0; group < axes; group += 3) { // of 3 axes, or 6
            for (int c = 0; c < 3 * coefficients[blocks[k][0]]; c++, at += 2, step++) {
                uint32_t value = c < 3 * columns[blocks[k][0]] ? number * 2654435761u + step * 40503u : 0;
                blob[at] = (uint8_t)(value >> 8);
                blob[at + 1] = (uint8_t)(value >> 16 & 7);
            }
        }
    }
    return at;
}

// blocks: the first one is an offset, every later one 19 signals times a gate, at most 7 of both. serial: of
// the sensor; "" for any. Returns the size.
static inline size_t make_map(uint8_t *blob, uint32_t number, int blocks, const char *serial)
{
    uint8_t kinds_and_gates[7][2] = {{BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE}};
    for (int k = 1; k < blocks; k++) {
        kinds_and_gates[k][0] = BT_MAP_KIND_SIGNAL;
        kinds_and_gates[k][1] = (uint8_t)(k - 1);
    }
    size_t bytes = put_map(blob, number, 3, kinds_and_gates, blocks);
    memcpy(blob + 4, serial, strlen(serial));
    return bytes;
}

// One of 6 axes that leaves less room than a block of 19 takes: eight of pairs, then eight of these.
static inline size_t make_big_map(uint8_t *blob, uint32_t number)
{
    static const uint8_t kinds[16] = {4, 4, 4, 4, 4, 4, 6, 6, 1, 1, 1, 1, 1, 1, 2, 2};
    uint8_t kinds_and_gates[16][2];
    for (uint8_t k = 0; k < 16; k++) {
        kinds_and_gates[k][0] = kinds[k];
        kinds_and_gates[k][1] = (uint8_t)(k < 6 ? k : k < 8 ? k - 6 : k < 14 ? k - 8 : k - 14);
    }
    return put_map(blob, number, 6, kinds_and_gates, 16);
}

#endif
