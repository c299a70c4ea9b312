#include "columns.h"

// With a constant size the loops over bytes are none.
static inline void read_values(const uint8_t *planes, size_t n, size_t parts, size_t size, const uint32_t *at,
                               uint8_t *out, size_t stride)
{
    size_t plane = n * parts;
    for (size_t j = 0; j < parts; j++) {
        uint64_t value = 0;
        for (size_t k = 0; k < n; k++) {
            uint64_t zigzag = 0;
            for (size_t b = 0; b < size; b++) {
                zigzag |= (uint64_t)planes[b * plane + j * n + k] << 8 * b;
            }
            value += (zigzag >> 1) ^ (0 - (zigzag & 1));
            uint8_t *to = out + at[k] * stride + j * size;
            for (size_t b = 0; b < size; b++) {
                to[b] = (uint8_t)(value >> 8 * b);
            }
        }
    }
}

void bt_columns(const uint8_t *planes, size_t n, const bt_stored_column *columns, size_t count,
                const uint32_t *at, uint8_t *out, size_t stride)
{
    for (const bt_stored_column *column = columns; column < columns + count; column++) {
        uint8_t *to = out + column->offset;
        switch (column->offset < 0 ? 0 : column->size) {
        case 1:
            read_values(planes, n, column->parts, 1, at, to, stride);
            break;
        case 2:
            read_values(planes, n, column->parts, 2, at, to, stride);
            break;
        case 4:
            read_values(planes, n, column->parts, 4, at, to, stride);
            break;
        case 8:
            read_values(planes, n, column->parts, 8, at, to, stride);
            break;
        default:
            break;
        }
        planes += n * column->parts * column->size;
    }
}
