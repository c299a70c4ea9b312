// Messages that were taken apart by kind, finger and field (recording/block.py): their columns, and the
// wire's bytes again.
#ifndef BIOTAC_REBUILD_H
#define BIOTAC_REBUILD_H

#include <stddef.h>
#include <stdint.h>

enum bt_rebuild_code {
    BT_REBUILD_RAW = 0xFF, // the next bytes of rest, up to and with a delimiter
};

// For each of n codes, the next row of tables[code], of row_bytes[code] bytes, as a frame of id[code]; or the
// next of rest. Tables end where their codes do, which is the caller's word. Returns how many bytes are in
// out: at most 256 a code and those of rest.
size_t bt_rebuild(const uint8_t *codes, size_t n, const uint8_t *const *tables, const uint32_t *row_bytes,
                  const uint8_t *id, const uint8_t *rest, size_t rest_bytes, uint8_t *out);

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
