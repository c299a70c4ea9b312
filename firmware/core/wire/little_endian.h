// Numbers as bytes, lowest byte first, as on the wire and in stored records.
#ifndef BIOTAC_LITTLE_ENDIAN_H
#define BIOTAC_LITTLE_ENDIAN_H

#include <stdint.h>

static inline void bt_put_u32(uint8_t *at, uint32_t value)
{
    for (int k = 0; k < 4; k++) {
        at[k] = (uint8_t)(value >> 8 * k);
    }
}

static inline uint32_t bt_get_u32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

// For an address that is a multiple of four: one load. Every board is little-endian.
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "words are read as they lie");
typedef uint32_t __attribute__((may_alias)) bt_word_in_place;
static inline uint32_t bt_get_aligned_u32(const uint8_t *at)
{
    return *(const bt_word_in_place *)(const void *)at;
}

static inline uint16_t bt_get_u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | at[1] << 8);
}

#endif
