// Consistent Overhead Byte Stuffing: no 0x00 in the output, so 0x00 can delimit frames.
#ifndef BIOTAC_COBS_H
#define BIOTAC_COBS_H

#include <stddef.h>
#include <stdint.h>

// One block, written byte by byte: at most 254 bytes, for which COBS adds exactly one. Kept by its writer:
typedef struct {
    uint8_t *code; // how far it is to the next zero is written here once that is known
    uint8_t *next;
} bt_cobs_block;

#define BT_COBS_BLOCK_BYTES 254

#ifndef BT_CDEF // for every byte that is sent, so these are inlined
static inline bt_cobs_block bt_cobs_begin(uint8_t *out)
{
    return (bt_cobs_block){.code = out, .next = out + 1};
}

static inline void bt_cobs_put(bt_cobs_block *block, uint8_t byte)
{
    if (byte != 0) {
        *block->next = byte;
    } else {
        *block->code = (uint8_t)(block->next - block->code);
        block->code = block->next;
    }
    block->next++;
}

// Returns where the encoded bytes end.
static inline uint8_t *bt_cobs_end(bt_cobs_block *block)
{
    *block->code = (uint8_t)(block->next - block->code);
    return block->next;
}
#endif

// in holds no delimiter; out has room for bytes. Returns the length, or -1 when in is not COBS.
// in and out may be the same buffer.
int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out);

#endif
