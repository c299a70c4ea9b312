// A map's coefficients as stored in the blob: 16 bits each, column by column, those of a group of axes side
// by side. Sums read them two at a time.
#ifndef BIOTAC_MAP_WORDS_H
#define BIOTAC_MAP_WORDS_H

#include "fixed_point.h"
#include "map/map.h"

// These words are read directly from the bytes of the blob, which requires a little-endian core.
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a map is read in place");
typedef uint32_t __attribute__((may_alias)) bt_map_word;
typedef int16_t __attribute__((may_alias)) bt_map_coefficient;

#define BT_MAP_ROW       10 // columns summed at a time: a row of pairs, or half of 19 + 1 electrodes
#define BT_MAP_ROW_WORDS (BT_MAP_ROW / 2) // per axis
#define BT_MAP_GROUP_MAX 4

static const uint8_t bt_map_coefficients[BT_MAP_KINDS] = BT_MAP_KIND_COEFFICIENTS;

// Coefficients per axis of a block of pairs, which has a row for each electrode, and of a block with a column
// for each electrode.
#define BT_MAP_PAIR_COEFFICIENTS (BT_ELECTRODES * BT_MAP_ROW)
#define BT_MAP_LINE_COEFFICIENTS (2 * BT_MAP_ROW)
_Static_assert(BT_MAP_LINE_COEFFICIENTS == BT_ELECTRODES + 1
                   && BT_MAP_PAIR_COEFFICIENTS == BT_ELECTRODES * 20 / 2,
               "two rows must hold all electrodes, and a ring of ten columns every pair once");

static inline const bt_map_word *bt_map_words(const bt_map *map)
{
    return (const bt_map_word *)(const void *)map->coefficients;
}

// Number of axes with coefficients side by side, from the given one on: three of force; three of torque, or
// four with torsion.
static inline int bt_map_group_width(const bt_map *map, int axis)
{
    return axis == 0 ? 3 : map->axes - axis;
}

// The sums of a row of factors for three axes.
void bt_map_row_of_3(const int32_t factor[BT_MAP_ROW], const bt_map_word *word, int32_t sum[3]);

static inline int32_t bt_map_second(uint32_t word)
{
    return bt_shift_down((int32_t)word, 16);
}

static inline int32_t bt_map_first(uint32_t word)
{
    return (int16_t)(uint16_t)word;
}

#endif
