#include "wire/cobs.h"

#include "wire/little_endian.h"

#include <stdint.h>

// True if a byte of the word is zero.
static inline int has_zero(uint32_t word)
{
    return ((word - 0x01010101u) & ~word & 0x80808080u) != 0;
}

// Write the distance to this zero at the last one; this place is patched next.
static inline uint8_t *patched(uint8_t *code, uint8_t *zero)
{
    *code = (uint8_t)(zero - code);
    return zero;
}

static inline uint8_t *bytewise(uint8_t *code, uint8_t *at, const uint8_t *end)
{
    for (; at < end; at++) {
        if (*at == 0) {
            code = patched(code, at);
        }
    }
    return code;
}

static inline uint8_t *wordwise(uint8_t *code, uint8_t *at)
{
    uint32_t word = bt_get_aligned_u32(at);
    if (has_zero(word)) {
        code = word << 24 == 0 ? patched(code, at) : code;
        code = word << 16 >> 24 == 0 ? patched(code, at + 1) : code;
        code = word << 8 >> 24 == 0 ? patched(code, at + 2) : code;
        code = word >> 24 == 0 ? patched(code, at + 3) : code;
    }
    return code;
}

// Most words have no zero: these are skipped four bytes at a time.
void bt_cobs_in_place(uint8_t *block, size_t bytes)
{
    const size_t before = -(uintptr_t)(block + 1) & 3;
    uint8_t *const end = block + bytes;
    uint8_t *at = before < bytes ? block + 1 + before : end;
    uint8_t *code = bytewise(block, block + 1, at);
    for (const uint8_t *whole = at + ((size_t)(end - at) & ~(size_t)7); at != whole; at += 8) {
        code = wordwise(code, at);
        code = wordwise(code, at + 4);
    }
    code = bytewise(code, at, end);
    *code = (uint8_t)(end - code);
}

// Comments that begin with @ are for the proof that only in and out are touched (tests/proofs/memory).
int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out)
{
    size_t at = 0;
    size_t k = 0;
    //@ loop invariant at <= k <= bytes; loop assigns at, k, out[0 .. bytes - 1];
    while (k < bytes) {
        uint8_t code = in[k++];
        if (code == 0 || (size_t)(code - 1) > bytes - k) {
            return -1;
        }
        /*@ loop invariant at < k && k + code <= bytes + n && n <= code;
            loop assigns n, at, k, out[0 .. bytes - 1]; */
        for (uint8_t n = 1; n < code; n++) {
            if (in[k] == 0) {
                return -1;
            }
            out[at++] = in[k++];
        }
        if (code != 0xFF && k < bytes) {
            out[at++] = 0;
        }
    }
    return (int)at;
}
