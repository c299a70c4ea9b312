// Rows of a message's integers as rows in user units (wire/frames.py).
#ifndef BIOTAC_UNITS_H
#define BIOTAC_UNITS_H

#include <stddef.h>
#include <stdint.h>

// A column: the place in a row of either kind, the integers' size in bytes (below 0: signed), the floats'
// size, 4 or 8. per_unit: steps of the integers per unit; 0: they are copied. The integers' invalid value,
// the least signed or the largest unsigned, becomes NaN.
typedef struct {
    uint32_t from, to, parts;
    int32_t from_bytes;
    uint32_t to_bytes;
    uint32_t per_unit;
} bt_unit_column;

void bt_units(const uint8_t *rows, size_t n, size_t stride, const bt_unit_column *columns, size_t count,
              uint8_t *out, size_t out_stride);

#endif
