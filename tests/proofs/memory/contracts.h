// Read before every proof: the parts of C11 that frama-c lacks, and the contracts that other proofs rely on,
// of functions that are proved by themselves.
#ifndef BIOTAC_CONTRACTS_H
#define BIOTAC_CONTRACTS_H

#define _Alignas(bytes) __attribute__((aligned(bytes)))

#include "wire/cobs.h"
#include "wire/crc32.h"

/*@ requires bytes <= 255 && \valid_read(in + (0 .. bytes - 1)) && \valid(out + (0 .. bytes - 1));
    assigns \result, out[0 .. bytes - 1] \from in[0 .. bytes - 1], bytes;
    ensures -1 <= \result <= bytes; */
int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out);

/*@ requires 1 <= bytes <= 255 && \valid(block + (0 .. bytes - 1));
    assigns block[0 .. bytes - 1] \from block[0 .. bytes - 1]; */
void bt_cobs_in_place(uint8_t *block, size_t bytes);

/*@ requires \valid_read(data + (0 .. bytes - 1));
    assigns \result \from data[0 .. bytes - 1]; */
uint32_t bt_crc32(const uint8_t *data, size_t bytes);

#endif
