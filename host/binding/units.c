#include "units.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static double value_of(const uint8_t *at, int32_t bytes, bool *invalid)
{
    uint16_t u2;
    int16_t i2;
    uint32_t u4;
    int32_t i4;
    switch (bytes) {
    case 1:
        *invalid = *at == UINT8_MAX;
        return *at;
    case 2:
        memcpy(&u2, at, sizeof u2);
        *invalid = u2 == UINT16_MAX;
        return u2;
    case -2:
        memcpy(&i2, at, sizeof i2);
        *invalid = i2 == INT16_MIN;
        return i2;
    case 4:
        memcpy(&u4, at, sizeof u4);
        *invalid = u4 == UINT32_MAX;
        return u4;
    default:
        memcpy(&i4, at, sizeof i4);
        *invalid = i4 == INT32_MIN;
        return i4;
    }
}

static void convert(const uint8_t *from, const bt_unit_column *column, uint8_t *to)
{
    const uint32_t bytes = (uint32_t)(column->from_bytes < 0 ? -column->from_bytes : column->from_bytes);
    for (uint32_t k = 0; k < column->parts; k++, from += bytes, to += column->to_bytes) {
        bool invalid;
        const double value = value_of(from, column->from_bytes, &invalid) / column->per_unit;
        const double number = invalid ? (double)NAN : value;
        const float single = (float)number;
        memcpy(to, column->to_bytes == sizeof single ? (const void *)&single : &number, column->to_bytes);
    }
}

void bt_units(const uint8_t *rows, size_t n, size_t stride, const bt_unit_column *columns, size_t count,
              uint8_t *out, size_t out_stride)
{
    for (size_t row = 0; row < n; row++, rows += stride, out += out_stride) {
        for (const bt_unit_column *column = columns; column < columns + count; column++) {
            if (column->per_unit == 0) {
                memcpy(out + column->to, rows + column->from, (size_t)column->parts * column->to_bytes);
            } else {
                convert(rows + column->from, column, out + column->to);
            }
        }
    }
}
