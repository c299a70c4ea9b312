// The fuzzer's input, taken byte by byte; past the end everything is 0.
#ifndef BIOTAC_FUZZ_INPUT_H
#define BIOTAC_FUZZ_INPUT_H

#include "wire/framing.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    const uint8_t *data;
    size_t left;
} fuzz_input;

static inline uint8_t next_u8(fuzz_input *in)
{
    if (in->left == 0) {
        return 0;
    }
    in->left--;
    return *in->data++;
}

static inline uint32_t next_u32(fuzz_input *in)
{
    uint32_t value = 0;
    for (int k = 0; k < 4; k++) {
        value |= (uint32_t)next_u8(in) << (8 * k);
    }
    return value;
}

// -limit..limit; a number within it is taken unchanged, so that a dictionary's values arrive.
static inline int32_t next_within(fuzz_input *in, int32_t limit)
{
    uint32_t value = next_u32(in);
    uint32_t sign = value >> 31;
    uint32_t magnitude = (sign ? 0 - value : value) % ((uint32_t)limit + 1);
    return sign ? -(int32_t)magnitude : (int32_t)magnitude;
}

// A framed message of the input's choice, of an odd length or damaged too; out has BT_ENCODED_MAX_BYTES.
typedef struct {
    uint8_t id;
    size_t payload_bytes;
    size_t wire_bytes;
} fuzz_message;

static inline fuzz_message next_message(fuzz_input *in, bool damage, uint8_t *out)
{
    uint8_t payload[BT_FRAME_MAX_BYTES] = {0};
    uint8_t id = next_u8(in);
    uint8_t odd = next_u8(in); // 0: the length that belongs to the id
    int known = bt_wire_payload_bytes(id);
    size_t bytes = odd == 0 && known >= 0 ? (size_t)known : odd % (BT_FRAME_MAX_BYTES - BT_CRC_BYTES);
    for (size_t k = 0; k < bytes; k++) {
        payload[k] = next_u8(in);
    }
    size_t wire_bytes = bt_frame_encode(id, payload, bytes, out);
    if (damage) {
        out[next_u8(in) % wire_bytes] ^= next_u8(in);
    }
    return (fuzz_message){id, bytes, wire_bytes};
}

// Names the fault and gives the fuzzer a crash.
#define FAIL(...) (fprintf(stderr, __VA_ARGS__), fputc('\n', stderr), abort())

#endif
