#include "map/map.h"

#include "map/factor_limits.h"
#include "map/lesson_limits.h"
#include "map/words.h"
#include "wire/little_endian.h"

#include <string.h>

#define MARGIN_AT (8 + BT_SERIAL_BYTES)
_Static_assert(
    BT_MAP_HEADER_BYTES == MARGIN_AT + 8 && BT_MAP_HEADER_BYTES % 4 == 0,
    "the header is four bytes, the serial number, a u32 and four u16, and keeps what follows aligned");
_Static_assert(BT_MAP_BLOCK_BYTES == 2 + BT_MAP_EXPONENTS && BT_MAP_BLOCK_BYTES % 4 == 0
                   && BT_MAP_EXPONENTS >= BT_MAP_AXES_MAX,
               "a block is its kind, its gate and an exponent for each axis");

void bt_map_close(bt_map *map)
{
    memset(map, 0, sizeof *map);
}

// Returns the bytes of all coefficients, or 0 for a list of blocks that breaks a rule.
static size_t judge_blocks(bt_map *map)
{
    size_t coefficients = 0;
    uint8_t seen[BT_MAP_KINDS] = {0}; // gates that each kind has had so far
    for (int b = 0; b < map->block_count; b++) {
        const uint8_t *block = map->blocks + b * BT_MAP_BLOCK_BYTES;
        uint8_t kind = block[0];
        uint8_t gate = block[1];
        if (kind >= BT_MAP_KINDS || gate >= BT_MAP_GATES || seen[kind] >> gate & 1) {
            return 0;
        }
        seen[kind] = (uint8_t)(seen[kind] | 1u << gate);
        map->kinds = (uint16_t)(map->kinds | 1u << kind);
        map->gates = (uint16_t)(map->gates | 1u << gate);
        for (int a = 0; a < BT_MAP_EXPONENTS; a++) {
            bool used = a < map->axes;
            if (block[2 + a] < used || block[2 + a] > (used ? BT_MAP_EXPONENT_MAX : 0)) {
                return 0;
            }
        }
        coefficients += bt_map_coefficients[kind];
    }
    return 2 * coefficients * map->axes;
}

// Largest magnitude of an axis's sum over `columns` columns, with factors up to `most`. first: the axis's
// first coefficient, one of `width` side by side.
static uint64_t largest(const bt_map_coefficient *first, int columns, int width, uint32_t most)
{
    uint32_t sum = 0;
    for (int k = 0; k < columns; k++) {
        sum += bt_abs32(first[k * width]);
    }
    return (uint64_t)sum * most;
}

// A sum shifted down by cut, plus one for rounding.
static uint64_t left(uint64_t sum, int cut)
{
    return (sum >> cut) + 1;
}

#define REFUSED UINT64_MAX

// Largest magnitude that a block adds to an axis, or REFUSED where a partial sum might not fit.
static uint64_t block_largest(const uint8_t *head, const bt_map_coefficient *first, int width, int exponent)
{
    static const uint16_t factor_max[BT_MAP_KINDS] = BT_MAP_FACTOR_MAX;
    int coefficients = bt_map_coefficients[head[0]];
    uint32_t most = factor_max[head[0]];
    uint64_t sum = 0;
    if (coefficients == BT_MAP_PAIR_COEFFICIENTS) {
        for (int i = 0; i < BT_ELECTRODES; i++) {
            uint64_t row = largest(first + i * BT_MAP_ROW * width, BT_MAP_ROW, width, most);
            if (row > INT32_MAX) {
                return REFUSED;
            }
            sum += left(row, BT_MAP_ROW_CUT) * most;
        }
    } else {
        sum = largest(first, coefficients, width, most);
    }
    if (sum > INT32_MAX - (1 << BT_MAP_GATE_CUT)) {
        return REFUSED;
    }
    if (head[1] != BT_MAP_GATE_ONE) {
        sum = left(sum, BT_MAP_GATE_CUT) * BT_MAP_GATE_MAX;
    }
    return sum + (1u << (exponent - 1)) > INT32_MAX ? REFUSED : left(sum, exponent);
}

// The number of columns is even: 19 electrodes, or a single column, are followed by one that is 0.
static bool last_is_zero(uint8_t kind, const bt_map_coefficient *first, int width)
{
    int coefficients = bt_map_coefficients[kind];
    for (int a = 0; a < width && coefficients != BT_MAP_PAIR_COEFFICIENTS; a++) {
        if (first[width * (coefficients - 1) + a] != 0) {
            return false;
        }
    }
    return true;
}

static bool coefficients_bounded(const bt_map *map)
{
    const bt_map_coefficient *first = (const bt_map_coefficient *)bt_map_words(map);
    uint64_t total[BT_MAP_AXES_MAX] = {0};
    for (int b = 0; b < map->block_count; b++) {
        const uint8_t *head = map->blocks + b * BT_MAP_BLOCK_BYTES;
        for (int axis = 0, width; axis < map->axes; axis += width) {
            width = bt_map_group_width(map, axis);
            if (!last_is_zero(head[0], first, width)) {
                return false;
            }
            for (int a = 0; a < width; a++) {
                uint64_t most = block_largest(head, first + a, width, head[2 + axis + a]);
                if (most == REFUSED || total[axis + a] + most > INT32_MAX) {
                    return false;
                }
                total[axis + a] += most;
            }
            first += width * bt_map_coefficients[head[0]];
        }
    }
    return true;
}

static bool lesson_bounded(const uint8_t *lesson)
{
    const bt_map_coefficient *first =
        (const bt_map_coefficient *)(const void *)(lesson + BT_LESSON_WEIGHT_AT);
    bool bounded = bt_get_u16(lesson + BT_LESSON_SCALE_AT) <= BT_LESSON_SCALE_MAX_Q8
                   && bt_get_u16(lesson + BT_LESSON_SIZE_AT) > 0
                   && bt_get_u16(lesson + BT_LESSON_MARGIN_AT + 2) <= BT_MARGIN_SHARE_MAX_Q8
                   && bt_get_u16(lesson + BT_LESSON_MARGIN_AT + 6) <= BT_MARGIN_SHARE_MAX_Q8
                   && lesson[BT_LESSON_EXPONENT_AT] <= BT_LESSON_EXPONENT_MAX;
    for (int row = 0; row < BT_LESSON_ROWS; row++) {
        const bt_map_coefficient *weight = first + row / 3 * 3 * BT_LESSON_FACTORS + row % 3;
        bounded = bounded && largest(weight, BT_LESSON_FACTORS, 3, BT_LESSON_FACTOR_MAX) <= INT32_MAX;
    }
    return bounded;
}

static bool axes_known(uint8_t axes)
{
    return axes == BT_MAP_AXES_FORCE || axes == BT_MAP_AXES_TORQUE || axes == BT_MAP_AXES_TORSION;
}

static uint8_t judge(bt_map *map, const uint8_t *blob, size_t bytes)
{
    if (bytes < BT_MAP_HEADER_BYTES || bytes > BT_MAP_MAX_BYTES) {
        return BT_ERROR_BAD_LENGTH;
    }
    if (blob[0] != BT_MAP_VERSION || !axes_known(blob[1]) || blob[3] > BT_LESSON_VERSION
        || (uintptr_t)blob % 4 != 0) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    map->axes = blob[1];
    map->block_count = blob[2];
    map->serial = blob + 4;
    map->made_s = bt_get_u32(blob + 4 + BT_SERIAL_BYTES);
    for (int part = 0; part < 2; part++) {
        map->margin.base_mn[part] = bt_get_u16(blob + MARGIN_AT + 4 * part);
        map->margin.share_q8[part] = bt_get_u16(blob + MARGIN_AT + 4 * part + 2);
        if (map->margin.share_q8[part] > BT_MARGIN_SHARE_MAX_Q8) {
            return BT_ERROR_OUT_OF_RANGE;
        }
    }
    map->lesson = blob[3] == BT_LESSON_VERSION ? blob + BT_MAP_HEADER_BYTES : NULL;
    map->blocks = blob + BT_MAP_HEADER_BYTES + (blob[3] != 0 ? BT_LESSON_BYTES : 0);
    size_t ahead = (size_t)(map->blocks - blob) + BT_MAP_BLOCK_BYTES * (size_t)map->block_count;
    if (map->block_count == 0 || bytes < ahead) {
        return BT_ERROR_BAD_LENGTH;
    }
    if (map->lesson != NULL && !lesson_bounded(map->lesson)) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    map->coefficients = blob + ahead;
    size_t coefficients = judge_blocks(map);
    if (coefficients == 0) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    if (bytes != ahead + coefficients) {
        return BT_ERROR_BAD_LENGTH;
    }
    return coefficients_bounded(map) ? BT_ERROR_OK : BT_ERROR_OUT_OF_RANGE;
}

uint8_t bt_map_open(bt_map *map, const uint8_t *blob, size_t bytes)
{
    bt_map_close(map);
    uint8_t error = judge(map, blob, bytes);
    if (error != BT_ERROR_OK) {
        bt_map_close(map);
    }
    return error;
}

bool bt_map_needs_pdc(const bt_map *map)
{
    return map->kinds >> BT_MAP_KIND_PRESSURE & 1;
}
