#include "map/map.h"

#include "map/words.h"
#include "wire/little_endian.h"

#include <string.h>

_Static_assert(BT_MAP_HEADER_BYTES == 8 + BT_MAP_SERIAL_BYTES && BT_MAP_HEADER_BYTES % 4 == 0,
               "the header is four bytes, the serial number and a u32, and keeps what follows aligned");
_Static_assert(BT_MAP_BLOCK_BYTES == 2 + BT_MAP_EXPONENTS && BT_MAP_BLOCK_BYTES % 4 == 0
                   && BT_MAP_EXPONENTS >= BT_MAP_AXES_MAX,
               "a block is its kind, its gate and an exponent for each axis");

void bt_map_close(bt_map *map)
{
    memset(map, 0, sizeof *map);
}

// Bytes of all coefficients, or 0 when the list of blocks breaks a rule.
static size_t judge_blocks(bt_map *map)
{
    size_t columns = 0;
    uint8_t seen[BT_MAP_KINDS] = {0}; // the gates that each kind has had
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
            if (block[2 + a] > (a < map->axes ? BT_MAP_EXPONENT_MAX : 0)) {
                return 0;
            }
        }
        columns += bt_map_columns[kind];
    }
    return 4 * columns * map->axes;
}

// Whether in each axis of so many columns, width axes side by side, the magnitudes' sum stays in bounds.
static bool bounded(const bt_map_word *words, int columns, int width)
{
    for (int a = 0; a < width; a++) {
        uint32_t sum = 0;
        for (int k = 0; k < columns; k++) {
            int64_t value = bt_map_value(words[width * k + a]);
            uint64_t magnitude = (uint64_t)(value < 0 ? -value : value);
            if (magnitude > BT_MAP_COEFFICIENT_SUM_MAX - sum) {
                return false;
            }
            sum += (uint32_t)magnitude;
        }
    }
    return true;
}

static bool coefficients_bounded(const bt_map *map)
{
    const bt_map_word *words = bt_map_words(map);
    for (int b = 0; b < map->block_count; b++) {
        uint8_t kind = map->blocks[b * BT_MAP_BLOCK_BYTES];
        for (int axis = 0; axis < map->axes; axis += 3) {
            int width = bt_map_group_width(map, axis);
            // Pairs are summed row by row, so that each row has bounds of its own.
            int columns = bt_map_columns[kind] == BT_MAP_PAIRS ? BT_ELECTRODES : bt_map_columns[kind];
            int last = bt_map_columns[kind] == BT_MAP_PAIRS ? 1 : columns;
            for (; columns >= last; columns--) {
                if (!bounded(words, columns, width)) {
                    return false;
                }
                words += width * columns;
            }
        }
    }
    return true;
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
    if (blob[0] != BT_MAP_VERSION || !axes_known(blob[1]) || blob[3] != 0 || (uintptr_t)blob % 4 != 0) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    map->axes = blob[1];
    map->block_count = blob[2];
    map->serial = blob + 4;
    map->made_s = bt_get_u32(blob + 4 + BT_MAP_SERIAL_BYTES);
    map->blocks = blob + BT_MAP_HEADER_BYTES;
    size_t ahead = BT_MAP_HEADER_BYTES + BT_MAP_BLOCK_BYTES * (size_t)map->block_count;
    if (map->block_count == 0 || bytes < ahead) {
        return BT_ERROR_BAD_LENGTH;
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
