// An electrode's relative change of conductance since rest, computed without a division:
// G(count) / G(tare) - 1 = e 4095 / ((4095 - count) tare), e = count - tare.
#ifndef BIOTAC_CONDUCTANCE_H
#define BIOTAC_CONDUCTANCE_H

#include "fixed_point.h"
#include "map/map_gen.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>

#define BT_CONDUCTANCE_MIN_Q4 (16 * BT_MAP_COUNT_MIN)
#define BT_CONDUCTANCE_MAX_Q4 (16 * BT_MAP_COUNT_MAX)
#define BT_CONDUCTANCE_MAX    (BT_MAP_RATIO_MAX << BT_MAP_CONDUCTANCE_Q)

// Bits of the divisor, (4095 - count) tare. From BT_DIVISOR_MIN on, shifting it up by at most 17 fills them.
#define BT_DIVISOR_BITS 28
#define BT_DIVISOR_MIN  1024
_Static_assert((int64_t)BT_CONDUCTANCE_MAX_Q4 *BT_FULL_SCALE_COUNT < 1 << BT_DIVISOR_BITS, "must fit");
_Static_assert(BT_DIVISOR_MIN << 17 == 1 << (BT_DIVISOR_BITS - 1), "must be shifted up by 17");
_Static_assert(((int64_t)BT_FULL_SCALE_COUNT << BT_MAP_CONDUCTANCE_Q) / BT_DIVISOR_MIN > BT_CONDUCTANCE_MAX,
               "with the least divisor even a sixteenth of a count must be limited");
_Static_assert(BT_MAP_CONDUCTANCE_Q == 13 && BT_MAP_GUESS_BITS == 6, "the shifts below are for these");

// e 4095 / den in units of 2^-CONDUCTANCE_Q, off by at most 0.5 + 0.52 |e 4095 / den| of them
// (tests/core/map). y is the reciprocal of the normalised divisor: |e| y < 2^32, and |e| y / 2^18 is u for a
// divisor with all bits.
static inline int32_t bt_conductance_of(int32_t e_q4, uint32_t den)
{
    static const uint16_t guesses[1 << BT_MAP_GUESS_BITS] = BT_MAP_GUESSES;
    int shift = 17;
    for (; den < 1u << (BT_DIVISOR_BITS - 1); den <<= 1) {
        shift--;
    }
    uint32_t d = den >> (BT_DIVISOR_BITS - 16);
    uint32_t guess = guesses[(d >> (15 - BT_MAP_GUESS_BITS)) - (1 << BT_MAP_GUESS_BITS)];
    uint32_t y = (guess * ((BT_MAP_GUESS_TWICE - d * guess) >> 16)) >> 15;
    uint32_t u = (((bt_abs32(e_q4) * y) >> shift) + 1) >> 1;
    return bt_with_sign(u < BT_CONDUCTANCE_MAX ? u : BT_CONDUCTANCE_MAX, e_q4);
}

// True for most counts and tares: within the range that maps were trained on, with a divisor of at least
// BT_DIVISOR_MIN.
#define BT_PLAIN_TARE_Q4 1024
_Static_assert((BT_FULL_SCALE_COUNT - BT_MAP_COUNT_MAX) * BT_PLAIN_TARE_Q4 >= BT_DIVISOR_MIN,
               "a plain count and tare must make no divisor below the least");

static inline bool bt_is_plain(uint32_t count, uint32_t tare_q4)
{
    return count - BT_MAP_COUNT_MIN <= BT_MAP_COUNT_MAX - BT_MAP_COUNT_MIN
           && tare_q4 - BT_PLAIN_TARE_Q4 <= BT_CONDUCTANCE_MAX_Q4 - BT_PLAIN_TARE_Q4;
}

// For any count and tare, limited to the range that maps were trained on; 0 where either is missing.
static inline int32_t bt_conductance_limited(int32_t count, int32_t tare_q4)
{
    int32_t now = bt_clamp(count, BT_MAP_COUNT_MIN, BT_MAP_COUNT_MAX);
    int32_t at_rest_q4 = bt_clamp(tare_q4, BT_CONDUCTANCE_MIN_Q4, BT_CONDUCTANCE_MAX_Q4);
    uint32_t den = (uint32_t)(BT_FULL_SCALE_COUNT - now) * (uint32_t)at_rest_q4;
    if (count == BT_INVALID_COUNT || tare_q4 == BT_INVALID_COUNT) {
        return 0;
    }
    // A smaller divisor is limited anyway.
    return bt_conductance_of(16 * now - at_rest_q4, den < BT_DIVISOR_MIN ? BT_DIVISOR_MIN : den);
}

static inline int32_t bt_conductance_plain(int32_t count, int32_t tare_q4)
{
    return bt_conductance_of(16 * count - tare_q4,
                             (uint32_t)(BT_FULL_SCALE_COUNT - count) * (uint32_t)tare_q4);
}

#endif
