// Consistent Overhead Byte Stuffing: no 0x00 in the output, so 0x00 can delimit frames.
#ifndef BIOTAC_COBS_H
#define BIOTAC_COBS_H

#include <stddef.h>
#include <stdint.h>

// Room that bt_cobs_encode needs for n bytes of input.
#define BT_COBS_MAX_BYTES(n) ((n) + (n) / 254 + 1)

// Returns the number of bytes written to out, which has BT_COBS_MAX_BYTES(bytes).
size_t bt_cobs_encode(const uint8_t *in, size_t bytes, uint8_t *out);

// in holds no delimiter; out has room for bytes. Returns the length, or -1 when in is not COBS.
// in and out may be the same buffer.
int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out);

#endif
