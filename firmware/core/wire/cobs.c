#include "wire/cobs.h"

#include <stdint.h>

// A byte of the word is zero; exact for whether, not for which.
static inline int has_zero(uint32_t word)
{
    return ((word - 0x01010101u) & ~word & 0x80808080u) != 0;
}

typedef uint32_t __attribute__((may_alias)) any_word;

// From the end, so that each distance is known when it is needed. Most words have no zero: these are passed
// by four bytes at a time.
void bt_cobs_in_place(uint8_t *block, size_t bytes)
{
    uint8_t *next = block + bytes;
    uint8_t *at = next;
#define PATCH(zero, byte)                                                                                    \
    if (zero) {                                                                                              \
        *(byte) = (uint8_t)(next - (byte));                                                                  \
        next = (byte);                                                                                       \
    }
    uint8_t *const whole = block + 5; // from here on down words end before the block does
    while (at > block + 1) {
        if (((uintptr_t)at & 3) != 0 || at < whole) {
            at--;
            PATCH(*at == 0, at)
            continue;
        }
        uint32_t word;
        do {
            at -= 4;
            word = *(const any_word *)(const void *)at;
        } while (!has_zero(word) && at >= whole);
        PATCH(word >> 24 == 0, at + 3) // its bytes in memory's order: see wire/messages_gen.c
        PATCH((uint8_t)(word >> 16) == 0, at + 2)
        PATCH((uint8_t)(word >> 8) == 0, at + 1)
        PATCH((uint8_t)word == 0, at)
    }
#undef PATCH
    *block = (uint8_t)(next - block);
}

int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out)
{
    size_t at = 0;
    size_t k = 0;
    while (k < bytes) {
        uint8_t code = in[k++];
        if (code == 0 || (size_t)(code - 1) > bytes - k) {
            return -1;
        }
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
