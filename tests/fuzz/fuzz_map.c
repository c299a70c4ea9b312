// Wrench maps that libFuzzer makes up: at the door as they are, and once they are open over frames it makes
// up too, against the sums that SPEC.md states, in 64 bits. Input: axes, number of blocks; per block kind,
// gate, exponents; per block a coefficient and the step to the next; how the head is spoilt; pressure; then
// counts and tares.
#include "input.h"

#include "map/map.h"

#include <string.h>

static const uint32_t columns_of[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS;
static uint32_t blob[BT_MAP_MAX_BYTES / 4 + 64];
static int64_t values[BT_MAP_MAX_BYTES / 4];

#define BLOCKS_MAX 4

static int32_t low_of(int64_t value)
{
    return (int16_t)(uint16_t)value;
}

// s(f, c) of SPEC.md, without splitting anything.
static int64_t sum_of(const int64_t *f, const int64_t *c, int columns, int stride)
{
    int64_t sum = columns >> 1;
    for (int k = 0; k < columns; k++) {
        sum += (f[k] * c[k * stride] - ((f[k] * c[k * stride]) & 0xFFFF)) / 65536; // floor
    }
    return sum;
}

static int64_t rounded(int64_t value, int bits)
{
    uint64_t magnitude = ((value < 0 ? 0 - (uint64_t)value : (uint64_t)value) + (1ull << (bits - 1))) >> bits;
    return value < 0 ? -(int64_t)magnitude : (int64_t)magnitude;
}

static int64_t block_of(int kind, const int64_t e[BT_ELECTRODES], int64_t pressure, const int64_t *c,
                        int axes)
{
    int64_t f[BT_ELECTRODES], rows[BT_ELECTRODES];
    int64_t one = 1 << BT_MAP_ONE_Q;
    switch (kind) {
    case BT_MAP_KIND_OFFSET:
        return sum_of(&one, c, 1, axes);
    case BT_MAP_KIND_PRESSURE:
        return sum_of(&pressure, c, 1, axes);
    case BT_MAP_KIND_SIGNAL_PAIRS:
        for (int i = 0; i < BT_ELECTRODES; i++) {
            rows[i] = sum_of(e + i, c, BT_ELECTRODES - i, axes);
            c += axes * (BT_ELECTRODES - i);
        }
        return sum_of(e, rows, BT_ELECTRODES, 1);
    default:
        for (int i = 0; i < BT_ELECTRODES; i++) {
            bool taken = kind == BT_MAP_KIND_SIGNAL || (kind == BT_MAP_KIND_BULGE) == (e[i] > 0);
            f[i] = taken ? e[i] : 0;
        }
        return sum_of(f, c, BT_ELECTRODES, axes);
    }
}

static void fail(const char *what)
{
    (void)fprintf(stderr, "%s\n", what);
    abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input in = {data, size};
    uint8_t *bytes = (uint8_t *)blob;
    static const int some[] = {BT_MAP_AXES_FORCE, BT_MAP_AXES_TORQUE, BT_MAP_AXES_TORSION};
    int axes = some[take_u8(&in) % 3];
    int count = 1 + take_u8(&in) % BLOCKS_MAX;
    bool plain = true; // only what is summed once more below
    uint32_t words = (BT_MAP_HEADER_BYTES + BT_MAP_BLOCK_BYTES * (uint32_t)count) / 4;
    memset(blob, 0, 4 * words);
    blob[0] = BT_MAP_VERSION | (uint32_t)axes << 8 | (uint32_t)count << 16;
    for (int b = 0; b < count; b++) {
        uint8_t *head = bytes + BT_MAP_HEADER_BYTES + b * BT_MAP_BLOCK_BYTES;
        head[0] = take_u8(&in) % BT_MAP_KINDS;
        head[1] = take_u8(&in) % BT_MAP_GATES;
        for (int a = 0; a < axes; a++) {
            head[2 + a] = take_u8(&in) % (BT_MAP_EXPONENT_MAX + 1);
        }
        plain = plain && head[1] == BT_MAP_GATE_ONE && head[0] != BT_MAP_KIND_CONDUCTANCE
                && head[0] != BT_MAP_KIND_CONDUCTANCE_PAIRS;
        uint32_t coefficient = take_u32(&in), step = take_u32(&in);
        for (uint32_t k = 0; k < columns_of[head[0]] * (uint32_t)axes; k++) {
            int64_t value = (int32_t)coefficient / (1 + (int32_t)(step & 31));
            if (words < BT_MAP_MAX_BYTES / 4) {
                values[words] = value;
                blob[words++] = (uint32_t)(value - low_of(value)) | (uint16_t)low_of(value);
            }
            coefficient += step;
        }
    }
    size_t length = 4 * words;
    uint8_t spoil = take_u8(&in);
    if (spoil & 1) {
        bytes[take_u8(&in) % (BT_MAP_HEADER_BYTES + BT_MAP_BLOCK_BYTES * BLOCKS_MAX)] = take_u8(&in);
        length -= take_u8(&in) % 8;
        plain = false;
    }
    bt_map map;
    if (bt_map_open(&map, bytes, length) != BT_ERROR_OK) {
        return 0;
    }
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    int64_t e[BT_ELECTRODES];
    int32_t pdc_q4 = take_within(&in, BT_MAP_FEATURE_MAX);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t both = take_u32(&in);
        counts[i] = both & 0xF000 ? (uint16_t)(both & BT_FULL_SCALE_COUNT) : BT_INVALID_COUNT;
        tare_q4[i] = (uint16_t)(both >> 16) > 65520 ? BT_INVALID_COUNT : (uint16_t)(both >> 16);
        bool missing = counts[i] == BT_INVALID_COUNT || tare_q4[i] == BT_INVALID_COUNT;
        e[i] = missing ? 0 : 16 * (int64_t)counts[i] - tare_q4[i];
    }
    int32_t result[BT_MAP_AXES_MAX] = {0}, force[3];
    bt_map_wrench(&map, counts, tare_q4, pdc_q4, result, result + 3, result + 6);
    bt_map_wrench(&map, counts, tare_q4, pdc_q4, force, NULL, NULL);
    if (memcmp(force, result, sizeof force) != 0) {
        fail("force depends on whether torque is wanted");
    }
    for (int a = 0; a < map.axes; a++) {
        if (result[a] > BT_MAP_RESULT_MAX || result[a] < -BT_MAP_RESULT_MAX) {
            fail("a result beyond its limit");
        }
        int64_t total = 0;
        uint32_t at = (BT_MAP_HEADER_BYTES + BT_MAP_BLOCK_BYTES * (uint32_t)map.block_count) / 4;
        for (int b = 0; plain && b < map.block_count; b++) {
            const uint8_t *head = map.blocks + b * BT_MAP_BLOCK_BYTES;
            uint32_t group = at + (uint32_t)(a / 3 * 3) * columns_of[head[0]];
            int width = a < 6 ? 3 : 1;
            total +=
                block_of(head[0], e, pdc_q4, values + group + a % 3, width) * ((int64_t)1 << head[2 + a]);
            at += columns_of[head[0]] * (uint32_t)map.axes;
        }
        int64_t limit = (int64_t)BT_MAP_RESULT_MAX << BT_MAP_RESULT_Q;
        total = total > limit ? limit : total < -limit ? -limit : total;
        if (plain && result[a] != rounded(total, BT_MAP_RESULT_Q)) {
            fail("a result that is not the specification's");
        }
    }
    return 0;
}
