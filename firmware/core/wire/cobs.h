// Consistent Overhead Byte Stuffing: no 0x00 in the output, so 0x00 can delimit frames.
#ifndef BIOTAC_COBS_H
#define BIOTAC_COBS_H

#include <stddef.h>
#include <stdint.h>

// One block: at most 254 bytes, for which COBS adds exactly one.
#define BT_COBS_BLOCK_BYTES 254

// Encode in place: the first byte of block becomes the distance to the first zero after it, and each zero the
// distance to the next one; the end of the block counts as a zero. bytes: the whole block, 1 to 255.
void bt_cobs_in_place(uint8_t *block, size_t bytes);

// in holds no delimiter; out has room for bytes. Returns the length, or -1 when in is not COBS.
// in and out may be the same buffer.
int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out);

#endif
