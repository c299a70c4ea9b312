// Wrench maps made word by word, for tests of what a core makes of them.
#ifndef BIOTAC_TEST_MAP_WORDS_H
#define BIOTAC_TEST_MAP_WORDS_H

#include "map/map.h"
#include "support.h"

#define WORD(high, low) ((uint32_t)(uint16_t)(high) << 16 | (uint16_t)(low))

static const uint32_t columns_of[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS;
static const uint32_t axes_of[] = {3, 6, 7};

#define SOME_AXES (sizeof axes_of / sizeof *axes_of)

// Of a map of one block: words of the blob.
#define HEAD  (BT_MAP_HEADER_BYTES / 4)
#define FIRST (HEAD + BT_MAP_BLOCK_BYTES / 4) // coefficient

// A blob under construction, in words, so that it lies as a board keeps it.
typedef struct {
    uint32_t word[BT_MAP_MAX_BYTES / 4 + 2];
    uint32_t words;
    uint32_t axes;
} blob;

static inline uint8_t *bytes_of(blob *its)
{
    return (uint8_t *)its->word;
}

static inline void begin(blob *its, uint32_t axes, uint32_t blocks)
{
    memset(its, 0, sizeof *its);
    its->axes = axes;
    its->word[0] = BT_MAP_VERSION | axes << 8 | blocks << 16;
    its->words = BT_MAP_HEADER_BYTES / 4;
}

static inline void block(blob *its, uint32_t kind, uint32_t gate, uint32_t exponent)
{
    its->word[its->words++] = kind | gate << 8 | exponent << 16 | exponent << 24;
    its->word[its->words++] = its->axes > 3 ? 0x01010101u * exponent : exponent;
    its->word[its->words++] = its->axes == 7 ? exponent : 0;
}

static inline void fill(blob *its, uint32_t kind, uint32_t value)
{
    for (uint32_t k = 0; k < columns_of[kind] * its->axes; k++) {
        its->word[its->words++] = value;
    }
}

// A block of one kind whose coefficients all are one.
static inline void one_block(blob *its, uint32_t axes, uint32_t kind, uint32_t gate, uint32_t exponent,
                             uint32_t value)
{
    begin(its, axes, 1);
    block(its, kind, gate, exponent);
    fill(its, kind, value);
}

static inline uint8_t opened(blob *its, bt_map *map)
{
    return bt_map_open(map, bytes_of(its), 4 * its->words);
}

#endif
