// The one place where the core rounds and saturates.
// Rounding is half away from zero (protocol/SPEC.md); saturation stops one short of the type's
// minimum, which means "invalid" on the wire.
#ifndef BIOTAC_FIX_H
#define BIOTAC_FIX_H

#include <stdint.h>

// num / den for den > 0. Works on magnitudes, so that -2.5 and 2.5 both move away from zero, and
// never adds to num, so that no input near INT64_MAX can wrap.
static inline int64_t bt_div_round(int64_t num, int64_t den)
{
    int64_t quotient = num / den;
    int64_t rest = num % den;
    int64_t rest_abs = rest < 0 ? -rest : rest;
    if (rest_abs >= den - rest_abs) {
        quotient += num < 0 ? -1 : 1;
    }
    return quotient;
}

static inline int64_t bt_clamp(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
}

// value held within +-INT32_MAX; *saturated is set, never cleared.
static inline int32_t bt_saturate_i32(int64_t value, int *saturated)
{
    if (value > INT32_MAX || value < -INT32_MAX) {
        *saturated = 1;
    }
    return (int32_t)bt_clamp(value, -INT32_MAX, INT32_MAX);
}

static inline uint64_t bt_abs(int64_t value)
{
    return value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
}

#endif
