// Wrench maps made word by word, for tests of the core's results.
#ifndef BIOTAC_TEST_MAP_WORDS_H
#define BIOTAC_TEST_MAP_WORDS_H

#include "map/map.h"
#include "support.h"

static const uint32_t columns_of[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS;
static const uint32_t coefficients_of[BT_MAP_KINDS] = BT_MAP_KIND_COEFFICIENTS;
static const uint32_t axes_of[] = {3, 6, 7};

#define SOME_AXES (sizeof axes_of / sizeof *axes_of)

// Words of the blob of a map of one block.
#define HEAD  (BT_MAP_HEADER_BYTES / 4)
#define FIRST (2 * HEAD + BT_MAP_BLOCK_BYTES / 2) // coefficient, in half words

// A blob under construction, in words, so that it lies as a board keeps it.
typedef struct {
    uint32_t word[BT_MAP_MAX_BYTES / 4 + 2];
    uint32_t words;
    uint32_t axes;
} blob;

static inline uint8_t *bytes_of(blob *stored)
{
    return (uint8_t *)stored->word;
}

static inline void begin(blob *stored, uint32_t axes, uint32_t blocks)
{
    memset(stored, 0, sizeof *stored);
    stored->axes = axes;
    stored->word[0] = BT_MAP_VERSION | axes << 8 | blocks << 16;
    stored->words = BT_MAP_HEADER_BYTES / 4;
}

static inline void block(blob *stored, uint32_t kind, uint32_t gate, uint32_t exponent)
{
    stored->word[stored->words++] = kind | gate << 8 | exponent << 16 | exponent << 24;
    stored->word[stored->words++] = stored->axes > 3 ? 0x01010101u * exponent : exponent;
    stored->word[stored->words++] = stored->axes == 7 ? exponent : 0;
}

// The half word of a column's coefficient in a block that begins at `first`: three axes side by side, then
// the others.
typedef int16_t __attribute__((may_alias)) half_word;
static inline half_word *half(blob *stored, uint32_t first, uint32_t kind, uint32_t column, uint32_t axis)
{
    half_word *halves = (half_word *)stored->word + first;
    return axis < 3 ? halves + 3 * column + axis
                    : halves + 3 * coefficients_of[kind] + (stored->axes - 3) * column + axis - 3;
}

// Coefficients of a block, all one and the same; where they begin.
static inline uint32_t fill(blob *stored, uint32_t kind, int16_t value)
{
    uint32_t first = 2 * stored->words;
    stored->words += coefficients_of[kind] * stored->axes / 2;
    for (uint32_t column = 0; column < columns_of[kind]; column++) {
        for (uint32_t axis = 0; axis < stored->axes; axis++) {
            *half(stored, first, kind, column, axis) = value;
        }
    }
    return first;
}

// A block of one kind with all coefficients one.
static inline void one_block(blob *stored, uint32_t axes, uint32_t kind, uint32_t gate, uint32_t exponent,
                             int16_t value)
{
    begin(stored, axes, 1);
    block(stored, kind, gate, exponent);
    (void)fill(stored, kind, value);
}

static inline uint8_t opened(blob *stored, bt_map *map)
{
    return bt_map_open(map, bytes_of(stored), 4 * stored->words);
}

#endif
