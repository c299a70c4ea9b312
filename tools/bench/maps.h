// Wrench maps to count and to hash: the blocks of a whole fitted map, with coefficients of every size by a
// fixed generator.
#ifndef BIOTAC_BENCH_MAPS_H
#define BIOTAC_BENCH_MAPS_H

#include "map/map.h"

typedef struct {
    bt_map map;
    size_t bytes;
    uint32_t blob[BT_MAP_MAX_BYTES / 4];
} bench_map;

static const uint8_t bench_map_pooled[][2] = {
    {BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE},      {BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_GATE_ONE},
    {BT_MAP_KIND_CONDUCTANCE, BT_MAP_GATE_ONE}, {BT_MAP_KIND_CONDUCTANCE_PAIRS, BT_MAP_GATE_ONE},
    {BT_MAP_KIND_COMPRESSION, BT_MAP_GATE_ONE}, {BT_MAP_KIND_BULGE, BT_MAP_GATE_ONE},
    {BT_MAP_KIND_COMPRESSION, BT_MAP_GATE_X},   {BT_MAP_KIND_BULGE, BT_MAP_GATE_X},
    {BT_MAP_KIND_COMPRESSION, BT_MAP_GATE_Y},   {BT_MAP_KIND_BULGE, BT_MAP_GATE_Y},
    {BT_MAP_KIND_PRESSURE, BT_MAP_GATE_ONE},    {BT_MAP_KIND_PRESSURE, BT_MAP_GATE_X},
    {BT_MAP_KIND_PRESSURE, BT_MAP_GATE_Y},
};
static const uint8_t bench_map_affine[][2] = {
    {BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE},
    {BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE},
};

static inline uint32_t bench_step(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed >> 8;
}

// False when the core refuses it: then nothing that follows means anything.
static inline bool bench_map_make(bench_map *out, const uint8_t (*blocks)[2], uint32_t count, uint32_t axes)
{
    static const uint32_t coefficients[BT_MAP_KINDS] = BT_MAP_KIND_COEFFICIENTS;
    uint32_t seed = 3;
    uint32_t words = BT_MAP_HEADER_BYTES / 4;
    for (uint32_t k = 0; k < words; k++) {
        out->blob[k] = 0;
    }
    out->blob[0] = BT_MAP_VERSION | axes << 8 | count << 16;
    for (uint32_t b = 0; b < count; b++) { // both builds are little-endian
        uint32_t exponents = 0x0A0A0A0A + (bench_step(&seed) & 0x03030303);
        out->blob[words++] = blocks[b][0] | (uint32_t)blocks[b][1] << 8 | exponents << 16;
        out->blob[words++] = axes >= 6 ? exponents : exponents & 0xFF;
        out->blob[words++] = axes == 7 ? exponents & 0xFF : 0;
    }
    for (uint32_t b = 0; b < count; b++) {
        bool pairs = coefficients[blocks[b][0]] == 190;
        for (uint32_t axis = 0; axis < axes; axis += axis == 0 ? 3 : axes) {
            uint32_t width = axis == 0 ? 3 : axes - 3; // of the group
            uint32_t values = coefficients[blocks[b][0]] * width;
            for (uint32_t k = 0; k < values; k += 2) {
                uint32_t first = bench_step(&seed) % 2001 - 1000; // a row of ten stays in bounds
                uint32_t second = bench_step(&seed) % 2001 - 1000;
                first = pairs || k < values - width ? first & 0xFFFF : 0; // behind 19 columns, or one
                second = pairs || k + 1 < values - width ? second << 16 : 0;
                out->blob[words++] = first | second;
            }
        }
    }
    out->bytes = 4 * words;
    return bt_map_open(&out->map, (const uint8_t *)out->blob, out->bytes) == BT_ERROR_OK;
}

#define BENCH_MAP_MAKE(out, blocks, axes) bench_map_make(out, blocks, sizeof(blocks) / sizeof *(blocks), axes)

#endif
