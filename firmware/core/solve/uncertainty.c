#include "solve/uncertainty.h"

#include "fixed_point.h"
#include "map/population.h"

#include <stdbool.h>

#define VARIANCE_PER_NOISE_Q16 (65536u / BT_ELECTRODES)

#define UNKNOWN BT_INVALID_COUNT
#define TOP     (UNKNOWN - 1u)

static uint16_t saturate(uint64_t value)
{
    return (uint16_t)(value > TOP ? TOP : value);
}

// The largest r with r * r <= n, a bit at a time.
static uint32_t root32(uint32_t n)
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

// The same of 64 bits, by halves (Zimmermann, Karatsuba Square Root, 1999): the upper half's root, then one
// division for the lower bits, which is one too high at most. n is first shifted up by an even number of
// bits.
static uint32_t root(uint64_t n)
{
    if (n >> 32 == 0) {
        return root32((uint32_t)n);
    }
    int shift = __builtin_clz((uint32_t)(n >> 32)) & ~1;
    n <<= shift;
    uint32_t high = (uint32_t)(n >> 32), low = (uint32_t)n;
    uint32_t s = root32(high);    // 2^15 <= s < 2^16
    uint32_t rest = high - s * s; // at most 2 s
    uint32_t half =
        rest << 15 | low >> 17; // half of (rest * 2^16 + low's upper half), which needs a bit more
    uint32_t q = BT_DIVIDE_U32(half, s);
    uint32_t left = (half - q * s) << 1 | (low >> 16 & 1);
    uint64_t r = ((uint64_t)s << 16) + q;
    int64_t remainder = (int64_t)(((uint64_t)left << 16 | (low & 0xFFFF))) - (int64_t)((uint64_t)q * q);
    return (uint32_t)(r - (remainder < 0)) >> (shift / 2);
}

// By four products of halves: a core without a long multiply would call a 64-bit routine.
static inline uint64_t times(uint32_t a, uint32_t b)
{
    uint32_t a_high = a >> 16, a_low = a & 0xFFFF;
    uint32_t b_high = b >> 16, b_low = b & 0xFFFF;
    uint32_t low = a_low * b_low;
    uint64_t middle = (uint64_t)(a_high * b_low) + a_low * b_high + (low >> 16);
    return ((uint64_t)(a_high * b_high) << 32) + (middle << 16) + (low & 0xFFFF);
}

uint32_t bt_sigma_count_q8(uint32_t noise_count2)
{
    return root(times(noise_count2, VARIANCE_PER_NOISE_Q16));
}

static uint32_t square_of(int32_t value)
{
    return bt_abs32(value) * bt_abs32(value);
}

#define QUOTIENT_BITS 25 // of 65535 in 1/256 um, and what is more saturates

// num / den in 1/256 um, den > 0, cut where it saturates anyway. By 32-bit divisions, each with a divisor
// that is a little too large, and what remains divided again; of den the first 32 bits count.
static uint32_t quotient_q8(uint64_t num, uint64_t den)
{
    uint32_t high = (uint32_t)(den >> 32);
    uint32_t quotient = 0;
    int shift = high != 0 ? 32 - __builtin_clz(high) : -__builtin_clz((uint32_t)den);
    if (high != 0) {
        den >>= shift;
        num >>= shift;
    } else if (shift == 0 || num >> (64 + shift) == 0) {
        den <<= -shift;
        num <<= -shift;
    } else {
        return 1u << QUOTIENT_BITS;
    }
    if (num >> QUOTIENT_BITS >= den) {
        return 1u << QUOTIENT_BITS;
    }
    const uint32_t divisor = ((uint32_t)den >> 16) + 1;
    uint32_t part = BT_DIVIDE_U32((uint32_t)(num >> QUOTIENT_BITS), divisor) << (QUOTIENT_BITS - 16);
    num -= times(part, (uint32_t)den); // below 2^43 now
    quotient += part;
    part = BT_DIVIDE_U32((uint32_t)(num >> 16), divisor);
    num -= times(part, (uint32_t)den);
    quotient += part;
    for (; num >= den; num -= den) {
        quotient++;
    }
    return quotient;
}

static uint16_t poc_sigma_um(const int32_t e_q4[BT_ELECTRODES], int weights, const int16_t poc_um[3],
                             uint32_t sigma_q8)
{
    bool tip = poc_um[0] > 0;
    uint64_t along = 0;  // of w'^2 (x - c_x)^2, on the cylinder
    uint64_t across = 0; // of w'^2 |r x n|^2; on the cylinder without x
    uint32_t total = 0;  // W: 19 of 24 bits
    int64_t lever = 0;   // of w r n
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (e_q4[i] == 0 || (e_q4[i] > 0 && weights != BT_POC_WEIGHTS_ABS_N2)) {
            continue;
        }
        uint32_t e = (bt_abs32(e_q4[i]) + 8) >> 4;
        uint32_t weight = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? e : e * e;
        uint32_t slope = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? 1 : 2 * e;
        uint32_t slope2 = slope * slope;
        const int16_t *r = bt_electrode_um[i];
        int32_t out = r[1] * poc_um[1] + r[2] * poc_um[2]; // each product is below 2^28
        uint32_t length2 = square_of(r[1]) + square_of(r[2]);
        if (tip) {
            out += r[0] * poc_um[0];
            length2 += square_of(r[0]);
        } else {
            along += times(slope2, square_of(r[0] - poc_um[0]));
        }
        out = bt_with_sign(BT_DIVIDE_U32(bt_abs32(out), BT_CORE_RADIUS_UM), out);
        uint32_t out2 = square_of(out); // with c rounded it may be more than the length
        across += times(slope2, length2 > out2 ? length2 - out2 : 0);
        total += weight;
        // out is below 2^15, so that its products with halves of the weight fit.
        lever += (int64_t)((int32_t)(weight >> 16) * out) * 65536 + (int32_t)(weight & 0xFFFF) * out;
    }
    if (lever <= 0) { // nothing weighs, or too little to say where
        return UNKNOWN;
    }
    uint32_t along_q8 = quotient_q8(times(root(along), sigma_q8), total);
    uint32_t across_q8 = quotient_q8(times(root(across), sigma_q8) * BT_CORE_RADIUS_UM, (uint64_t)lever);
    uint64_t square_q16 = times(along_q8, along_q8) + times(across_q8, across_q8);
    return saturate((root(square_q16) + 128ull) >> 8);
}

static void force_sigma(const bt_solve_settings *settings, uint32_t sigma_q8, bt_msg_frame *msg)
{
    for (int d = 0; d < 3; d++) {
        uint64_t sigma = times(settings->force_per_count_100un_q16[d], sigma_q8);
        msg->force_sigma_100un[d] = saturate((sigma + (1 << 23)) >> 24);
    }
}

void bt_sigma(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t noise_count2,
              bt_msg_frame *msg)
{
    bool forced = msg->force_100un[0] != BT_INVALID_I32;
    const uint32_t its = BT_FRAME_FLAG_POPULATION | BT_FRAME_FLAG_OUTSIDE;
    if (forced && (msg->flags & its) == BT_FRAME_FLAG_POPULATION) {
        msg->force_sigma_100un[0] = bt_population_sigma_100un[0];
        msg->force_sigma_100un[1] = bt_population_sigma_100un[1];
        msg->force_sigma_100un[2] = bt_population_sigma_100un[2];
    }
    if (noise_count2 == 0) {
        return; // not measured yet
    }
    uint32_t sigma_q8 = bt_sigma_count_q8(noise_count2);
    if (msg->poc_um[0] != BT_INVALID_I16) {
        msg->poc_sigma_um = poc_sigma_um(e_q4, settings->poc_weights, msg->poc_um, sigma_q8);
    }
    if (forced && settings->map == NULL && !settings->population) { // a map's depends on where it is touched
        force_sigma(settings, sigma_q8, msg);
    }
}
