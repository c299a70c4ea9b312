// Wrench maps that libFuzzer makes up: raw ones at the check, and opened ones over frames that it makes
// up too, against the sums that SPEC.md states, in 64 bits. Input: axes, number of blocks; per block kind,
// gate, exponents; per block a coefficient and the step to the next; how the head is spoilt; pressure; then
// counts and tares.
#include "input.h"

#include "map/map.h"

#include <string.h>

static const uint32_t columns_of[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS;
static const uint32_t coefficients_of[BT_MAP_KINDS] = BT_MAP_KIND_COEFFICIENTS;
static uint32_t blob[BT_MAP_MAX_BYTES / 4 + 64];

#define BLOCKS_MAX 4

// Half up, as every cut is.
static int64_t rounded(int64_t value, int bits)
{
    int64_t up = value + ((int64_t)1 << (bits - 1));
    return (up - (up & (((int64_t)1 << bits) - 1))) / ((int64_t)1 << bits);
}

// A block's sum as SPEC.md has it: c is the first coefficient of the axis, of width side by side.
static int64_t block_of(int kind, const int64_t e[BT_ELECTRODES], int64_t pressure, const int16_t *c,
                        int width)
{
    int64_t sum = 0;
    switch (kind) {
    case BT_MAP_KIND_OFFSET:
        return c[0] * ((int64_t)1 << BT_MAP_ONE_Q);
    case BT_MAP_KIND_PRESSURE:
        return c[0] * pressure;
    case BT_MAP_KIND_SIGNAL_PAIRS:
        for (int i = 0; i < BT_ELECTRODES; i++) {
            int64_t row = 0;
            for (int k = 0; k < 10; k++) {
                row += e[(i + k) % BT_ELECTRODES] * c[(10 * i + k) * width];
            }
            int64_t product = row * e[i];
            sum += (product - (product & 0xFFFF)) / (1 << BT_MAP_ROW_CUT); // floor
        }
        return sum;
    default:
        for (int i = 0; i < BT_ELECTRODES; i++) {
            bool counted = kind == BT_MAP_KIND_SIGNAL || (kind == BT_MAP_KIND_BULGE) == (e[i] > 0);
            sum += counted ? e[i] * c[i * width] : 0;
        }
        return sum;
    }
}

static void fail(const char *failure)
{
    (void)fprintf(stderr, "%s\n", failure);
    abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input in = {data, size};
    uint8_t *bytes = (uint8_t *)blob;
    static const int some[] = {BT_MAP_AXES_FORCE, BT_MAP_AXES_TORQUE, BT_MAP_AXES_TORSION};
    int axes = some[next_u8(&in) % 3];
    int count = 1 + next_u8(&in) % BLOCKS_MAX;
    bool plain = true; // only for parts that are summed once more below
    uint32_t words = (BT_MAP_HEADER_BYTES + BT_MAP_BLOCK_BYTES * (uint32_t)count) / 4;
    memset(blob, 0, 4 * words);
    blob[0] = BT_MAP_VERSION | (uint32_t)axes << 8 | (uint32_t)count << 16;
    for (int b = 0; b < count; b++) {
        uint8_t *head = bytes + BT_MAP_HEADER_BYTES + b * BT_MAP_BLOCK_BYTES;
        head[0] = next_u8(&in) % BT_MAP_KINDS;
        head[1] = next_u8(&in) % BT_MAP_GATES;
        for (int a = 0; a < axes; a++) {
            head[2 + a] = 1 + next_u8(&in) % BT_MAP_EXPONENT_MAX;
        }
        plain = plain && head[1] == BT_MAP_GATE_ONE && head[0] != BT_MAP_KIND_CONDUCTANCE
                && head[0] != BT_MAP_KIND_CONDUCTANCE_PAIRS;
        uint32_t coefficient = next_u32(&in), step = next_u32(&in);
        for (int group = 0; group < axes; group += group == 0 ? 3 : 4) {
            uint32_t width = group == 0 ? 3 : (uint32_t)axes - 3;
            for (uint32_t k = 0; k < coefficients_of[head[0]] * width; k += 2) {
                uint32_t both = 0;
                for (uint32_t h = 0; h < 2; h++) {
                    int32_t value = (int16_t)(coefficient >> 16) / (1 + (int32_t)(step & 31));
                    both |= k + h < columns_of[head[0]] * width ? (uint32_t)(uint16_t)value << 16 * h : 0;
                    coefficient += step;
                }
                if (words < BT_MAP_MAX_BYTES / 4) {
                    blob[words++] = both;
                }
            }
        }
    }
    size_t length = 4 * words;
    uint8_t spoil = next_u8(&in);
    if (spoil & 1) {
        bytes[next_u8(&in) % (BT_MAP_HEADER_BYTES + BT_MAP_BLOCK_BYTES * BLOCKS_MAX)] = next_u8(&in);
        length -= next_u8(&in) % 8;
        plain = false;
    }
    bt_map map;
    if (bt_map_open(&map, bytes, length) != BT_ERROR_OK) {
        return 0;
    }
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    int64_t e[BT_ELECTRODES];
    int32_t pdc_q4 = next_within(&in, BT_E_MAX_Q4);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t both = next_u32(&in);
        counts[i] = both & 0xF000 ? (uint16_t)(both & BT_FULL_SCALE_COUNT) : BT_INVALID_COUNT;
        tare_q4[i] = (uint16_t)(both >> 16) > 65520 ? BT_INVALID_COUNT : (uint16_t)(both >> 16);
        bool missing = counts[i] == BT_INVALID_COUNT || tare_q4[i] == BT_INVALID_COUNT;
        e[i] = missing ? 0 : rounded(16 * (int64_t)counts[i] - tare_q4[i], 4 - BT_MAP_SIGNAL_Q);
    }
    int32_t result[BT_MAP_AXES_MAX] = {0}, force[3];
    bt_map_wrench(&map, counts, tare_q4, pdc_q4, result, result + 3, result + 6);
    bt_map_wrench(&map, counts, tare_q4, pdc_q4, force, NULL, NULL);
    if (memcmp(force, result, sizeof force) != 0) {
        fail("force depends on whether torque is wanted");
    }
    for (int a = 0; a < map.axes; a++) {
        if (result[a] > BT_MAP_RESULT_MAX || result[a] < -BT_MAP_RESULT_MAX) {
            fail("a result exceeds its limit");
        }
        int64_t total = 0;
        const int16_t *block = (const int16_t *)(const void *)map.coefficients;
        for (int b = 0; plain && b < map.block_count; b++) {
            const uint8_t *head = map.blocks + b * BT_MAP_BLOCK_BYTES;
            int width = a < 3 ? 3 : map.axes - 3;
            const int16_t *c = block + (a < 3 ? a : 3 * (int)coefficients_of[head[0]] + a - 3);
            int64_t pressure = pdc_q4 < 0 ? -((1 - pdc_q4) / 2) : pdc_q4 / 2; // floor
            total += rounded(block_of(head[0], e, pressure, c, width), head[2 + a]);
            block += coefficients_of[head[0]] * (uint32_t)map.axes;
        }
        total = total > BT_MAP_RESULT_MAX    ? BT_MAP_RESULT_MAX
                : total < -BT_MAP_RESULT_MAX ? -BT_MAP_RESULT_MAX
                                             : total;
        if (plain && result[a] != total) {
            fail("a result differs from the specification");
        }
    }
    return 0;
}
