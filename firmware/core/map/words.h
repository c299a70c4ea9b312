// A map's coefficients as they lie in the blob: i16 low, i16 high, value high * 2^16 + low. Both halves are
// signed, so that neither needs more than one instruction to be had and each times a 16-bit factor fits 32
// bits.
#ifndef BIOTAC_MAP_WORD_H
#define BIOTAC_MAP_WORD_H

#include "fixed_point.h"
#include "map/map.h"

// The blob is bytes; these words are read out of it as they are, on cores of the same byte order only.
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a map is read in place");
typedef uint32_t __attribute__((may_alias)) bt_map_word;

static const uint8_t bt_map_columns[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS;

static inline const bt_map_word *bt_map_words(const bt_map *map)
{
    return (const bt_map_word *)(const void *)map->coefficients;
}

// Axes whose coefficients lie side by side, from the given one on: three of force, three of torque, torsion
// alone.
static inline int bt_map_group_width(const bt_map *map, int axis)
{
    return map->axes - axis < 3 ? map->axes - axis : 3;
}

static inline int32_t bt_map_high(uint32_t word)
{
    return bt_shift_down((int32_t)word, 16);
}

static inline int32_t bt_map_low(uint32_t word)
{
    return (int16_t)(uint16_t)word;
}

// value < 2^31 - 2^15.
static inline uint32_t bt_map_word_of(int32_t value)
{
    int32_t low = (int16_t)(uint16_t)value;
    return (uint32_t)(value - low) | (uint16_t)low;
}

static inline int64_t bt_map_value(uint32_t word)
{
    return (int64_t)bt_map_high(word) * 65536 + bt_map_low(word);
}

#endif
