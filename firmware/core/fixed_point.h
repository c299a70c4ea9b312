// Division, shifting and rounding in the core. Published values round half away from zero (protocol/SPEC.md).
// Nothing here saturates: every caller's range is bounded at compile time.
#ifndef BIOTAC_FIXED_POINT_H
#define BIOTAC_FIXED_POINT_H

#include <stdint.h>

// Marks functions that are cheaper to call than to inline.
#define BT_NOINLINE __attribute__((noinline))

// Unrolls loops over all electrodes: on a core without branch prediction, counting costs as much as the work.
#if defined(__GNUC__) && !defined(__clang__)
#define BT_UNROLL _Pragma("GCC unroll 20")
#else
#define BT_UNROLL
#endif

// num / den, rounded half away from zero, for den > 0. No input near INT64_MAX wraps: num is never added to.
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

// The same for num below 2^32 - den / 2, in one 32-bit division.
static inline uint32_t bt_div_round_u32(uint32_t num, uint32_t den)
{
    return (num + den / 2) / den;
}

static inline uint64_t bt_abs(int64_t value)
{
    return value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
}

static inline uint32_t bt_abs32(int32_t value)
{
    return value < 0 ? 0 - (uint32_t)value : (uint32_t)value;
}

// value / 2^bits, rounded towards minus infinity. Right-shifting a negative number is implementation-defined;
// every compiler we use copies the sign, and one that does not fails this assertion.
_Static_assert(-1 >> 1 == -1, "the compiler must shift signed numbers arithmetically");
static inline int32_t bt_shift_down(int32_t value, int bits)
{
    return value >> bits;
}

// value / 2^bits, rounded half away from zero, for bits > 0 and |value| < 2^62.
static inline int64_t bt_shift_round(int64_t value, int bits)
{
    uint64_t magnitude = (bt_abs(value) + ((uint64_t)1 << (bits - 1))) >> bits;
    return value < 0 ? -(int64_t)magnitude : (int64_t)magnitude;
}

static inline int32_t bt_clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

static inline uint32_t bt_at_most(uint32_t value, uint32_t most)
{
    return value < most ? value : most;
}

// What value is above `over`.
static inline uint32_t bt_excess(uint32_t value, uint32_t over)
{
    return value > over ? value - over : 0;
}

// magnitude with the sign of `sign`, without a branch. magnitude < 2^31.
static inline int32_t bt_with_sign(uint32_t magnitude, int32_t sign)
{
    int32_t mask = bt_shift_down(sign, 31);
    return ((int32_t)magnitude ^ mask) - mask;
}

// count + 1, at most `most`.
static inline uint8_t bt_count_up(uint8_t count, uint8_t most)
{
    return (uint8_t)(count + (count < most));
}

static inline int bt_bit_length(uint32_t value)
{
    return value == 0 ? 0 : 32 - __builtin_clz(value);
}

// magnitude * multiplier / 2^(32 + bits), rounded half up. magnitude < 2^31, bits 1..7; the multiplier, at
// most 2^30, comes as two 16-bit halves.
// Uses four 16-bit products, because a core without a long multiply would call a 64-bit routine. The sum of
// the middle products stays below 2^32 because magnitude < 2^31 and multiplier <= 2^30.
static inline uint32_t bt_scale(uint32_t magnitude, uint32_t m_high, uint32_t m_low, int bits)
{
    uint32_t high = magnitude >> 16;
    uint32_t low = magnitude & 0xFFFF;
    uint32_t middle = high * m_low + low * m_high + (low * m_low >> 16);
    uint32_t top = high * m_high + (middle >> 16);
    return (top + (1u << (bits - 1))) >> bits;
}

// The largest r with r * r <= n, a bit at a time.
static inline uint32_t bt_root_u32(uint32_t n)
{
    uint32_t r = 0;
    for (uint32_t bit = 1u << 30; bit != 0; bit >>= 2) {
        uint32_t trial = r + bit;
        r >>= 1;
        if (n >= trial) {
            n -= trial;
            r += bit;
        }
    }
    return r;
}

#endif
