// What a fuzzer hands over, taken byte by byte; past its end everything is 0.
#ifndef BIOTAC_FUZZ_INPUT_H
#define BIOTAC_FUZZ_INPUT_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    const uint8_t *data;
    size_t left;
} fuzz_input;

static inline uint8_t take_u8(fuzz_input *in)
{
    if (in->left == 0) {
        return 0;
    }
    in->left--;
    return *in->data++;
}

static inline uint32_t take_u32(fuzz_input *in)
{
    uint32_t value = 0;
    for (int k = 0; k < 4; k++) {
        value |= (uint32_t)take_u8(in) << (8 * k);
    }
    return value;
}

// -limit..limit; a number within it is taken as it is, so that a dictionary's values arrive.
static inline int32_t take_within(fuzz_input *in, int32_t limit)
{
    uint32_t value = take_u32(in);
    uint32_t sign = value >> 31;
    uint32_t magnitude = (sign ? 0 - value : value) % ((uint32_t)limit + 1);
    return sign ? -(int32_t)magnitude : (int32_t)magnitude;
}

// Says what is wrong and gives the fuzzer its crash.
#define FAIL(...) (fprintf(stderr, __VA_ARGS__), fputc('\n', stderr), abort())

#endif
