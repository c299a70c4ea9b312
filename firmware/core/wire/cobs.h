// Consistent Overhead Byte Stuffing: no 0x00 in the output, so 0x00 can delimit frames.
#ifndef BIOTAC_COBS_H
#define BIOTAC_COBS_H

#include <stddef.h>
#include <stdint.h>

// One block: at most 254 bytes, for which COBS adds exactly one.
#define BT_COBS_BLOCK_BYTES 254

// Of the bytes behind the first of block, each zero becomes the distance to the next one, and the first that
// to the first zero; the block's end counts as one. bytes: of the whole block, 1 to 255.
void bt_cobs_in_place(uint8_t *block, size_t bytes);

// in holds no delimiter; out has room for bytes. Returns the length, or -1 when in is not COBS.
// in and out may be the same buffer.
int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out);

#endif
