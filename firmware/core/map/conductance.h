// By how much an electrode conducts otherwise than at rest: G(count) / G(tare) - 1 = e 4095 / ((4095 - count)
// tare), e = count - tare, as a fraction whose quotient each map takes with the digits that it needs.
#ifndef BIOTAC_CONDUCTANCE_H
#define BIOTAC_CONDUCTANCE_H

#include "fixed_point.h"
#include "map/map_gen.h"
#include "wire/sensor_gen.h"

#define BT_CONDUCTANCE_MIN_Q4 (16 * BT_MAP_COUNT_MIN)
#define BT_CONDUCTANCE_MAX_Q4 (16 * BT_MAP_COUNT_MAX)
_Static_assert((int64_t)BT_CONDUCTANCE_MAX_Q4 *BT_FULL_SCALE_COUNT < 1 << 28, "both terms must have 28 bits");

typedef struct {
    uint32_t num; // both below 2^28
    uint32_t den;
    int32_t e_q4; // whose sign the quotient has
} bt_conductance;

// count and tare are limited to what the maps were trained on.
static inline bt_conductance bt_conductance_of(int32_t count, int32_t tare_q4)
{
    int32_t at_rest_q4 = bt_limited(tare_q4, BT_CONDUCTANCE_MIN_Q4, BT_CONDUCTANCE_MAX_Q4);
    int32_t now = bt_limited(count, BT_MAP_COUNT_MIN, BT_MAP_COUNT_MAX);
    int32_t e_q4 = 16 * now - at_rest_q4;
    uint32_t num = bt_abs32(e_q4) * BT_FULL_SCALE_COUNT;
    uint32_t den = (uint32_t)(BT_FULL_SCALE_COUNT - now) * (uint32_t)at_rest_q4;
    return (bt_conductance){num, den, e_q4};
}

#endif
