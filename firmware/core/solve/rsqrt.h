// Reciprocal square root, by table and linear interpolation.
#ifndef BIOTAC_RSQRT_H
#define BIOTAC_RSQRT_H

#include "solve/rsqrt_gen.h"

// BT_ROOT_SHARE * 2^32 / sqrt(q) for q >= 2^30 (rsqrt_gen.h): 17 bits. The relative error is at most 2^-17.4,
// the distance of a chord from the curve, plus one unit from rounding the entries and the product.
static inline uint32_t bt_root_inverse(uint32_t q)
{
    const uint16_t *at = bt_root_table + ((q >> BT_ROOT_STEP_BITS) - (1u << (30 - BT_ROOT_STEP_BITS)));
    uint32_t part = q >> (BT_ROOT_STEP_BITS - 16) & 0xFFFF;
    uint32_t step = (uint32_t)at[0] - at[1];
    return BT_ROOT_BASE + at[0] - ((step * part + (1u << 15)) >> 16);
}

#endif
