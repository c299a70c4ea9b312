// Columns of a recording's tables (recording/block.py).
#ifndef BIOTAC_COLUMNS_H
#define BIOTAC_COLUMNS_H

#include <stddef.h>
#include <stdint.h>

// A column as it is stored: n x parts values of size bytes (1, 2, 4 or 8).
typedef struct {
    uint32_t size;
    uint32_t parts;
    int32_t offset; // of the first in a row that is read; below 0: not wanted
} bt_stored_column;

// Columns of n rows from byte planes of zigzag changes, one after the other: row k becomes row at[k] of out,
// whose rows are stride bytes long.
void bt_columns(const uint8_t *planes, size_t n, const bt_stored_column *columns, size_t count,
                const uint32_t *at, uint8_t *out, size_t stride);

#endif
