#include "solve/uncertainty.h"

#include "fixed_point.h"

#include <stdbool.h>

#define VARIANCE_PER_NOISE_Q16 (65536u / BT_ELECTRODES)

#define UNKNOWN BT_INVALID_COUNT
#define TOP     (UNKNOWN - 1u)

static uint16_t saturate(uint64_t value)
{
    return (uint16_t)(value > TOP ? TOP : value);
}

// The largest r with r * r <= n, by halves (Zimmermann, Karatsuba Square Root, 1999): the upper half's root,
// then the lower bits by one division, at most one too high. n is first shifted up by an even number of bits.
static uint32_t root(uint64_t n)
{
    if (n >> 32 == 0) {
        return bt_root_u32((uint32_t)n);
    }
    int shift = __builtin_clz((uint32_t)(n >> 32)) & ~1;
    n <<= shift;
    uint32_t high = (uint32_t)(n >> 32), low = (uint32_t)n;
    uint32_t s = bt_root_u32(high);         // 2^15 <= s < 2^16
    uint32_t rest = high - s * s;           // at most 2 s
    uint32_t half = rest << 15 | low >> 17; // half of (rest << 16 | low >> 16), which itself takes 33 bits
    uint32_t q = half / s;
    uint32_t left = (half - q * s) << 1 | (low >> 16 & 1);
    uint64_t r = ((uint64_t)s << 16) + q;
    int64_t remainder = (int64_t)(((uint64_t)left << 16 | (low & 0xFFFF))) - (int64_t)((uint64_t)q * q);
    return (uint32_t)(r - (remainder < 0)) >> (shift / 2);
}

// Four products of halves: a core without a long multiply would call a 64-bit routine.
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

// ---- the point of contact ------------------------------------------------------------------------------

// m * 2^e, where m has 16 bits with the highest one set, or is zero. Each step is off by at most 2^-15 of
// itself: 0.03 um in a sigma of 1 mm.
typedef struct {
    uint32_t m;
    int e;
} scaled;

static scaled scaled_of(uint32_t value, int e)
{
    if (value == 0) {
        return (scaled){0, 0};
    }
    int up = __builtin_clz(value) - 16;
    return (scaled){up >= 0 ? value << up : value >> -up, e - up};
}

static scaled product(scaled a, scaled b)
{
    return scaled_of(a.m * b.m, a.e + b.e);
}

static scaled ratio(scaled a, scaled b)
{
    return scaled_of((a.m << 16) / b.m, a.e - b.e - 16);
}

static scaled root_of(uint32_t value)
{
    if (value == 0) {
        return (scaled){0, 0};
    }
    int up = __builtin_clz(value) & ~1;
    return (scaled){bt_root_u32(value << up), -up / 2};
}

// sqrt(a^2 + b^2)
static scaled together(scaled a, scaled b)
{
    if (a.m == 0 || (b.m != 0 && b.e > a.e)) {
        scaled other = a;
        a = b;
        b = other;
    }
    uint32_t less = b.m == 0 || a.e - b.e > 15 ? 0 : b.m >> (a.e - b.e + 1);
    uint32_t more = a.m >> 1;
    scaled sum = root_of(more * more + less * less);
    return scaled_of(sum.m, sum.e + a.e + 1);
}

static uint16_t rounded(scaled value)
{
    if (value.e > 0) {
        return TOP;
    }
    return value.e < -16 ? 0 : saturate((((uint64_t)value.m << 1 >> -value.e) + 1) >> 1);
}

#define WEIGHT_BITS 13 // of all weights together
#define SQUARE_BITS 10 // cut off distances^2 in um^2
#define EQUAL_BITS  8  // of slopes that are all 1 (n = 1)
#define FARTHEST_UM 18400u
// FARTHEST_UM is between electrodes along the finger, or from one to a line through the middle of the tip.
_Static_assert(((FARTHEST_UM * FARTHEST_UM >> SQUARE_BITS) + 1) * ((1ull << WEIGHT_BITS) + BT_ELECTRODES)
                   <= UINT32_MAX,
               "sums of weighted squares fit");
#define N_PER_UM_Q30 ((1u << 31) / BT_CORE_RADIUS_UM) // to n of 15 bits
_Static_assert((1ull << 31) / BT_CORE_RADIUS_UM * (BT_CORE_RADIUS_UM + 2) <= UINT32_MAX, "a point fits");

static uint32_t square_of(int32_t um)
{
    return bt_abs32(um) * bt_abs32(um);
}

static inline uint32_t less_bits(uint32_t square_um2)
{
    return (square_um2 + (1u << (SQUARE_BITS - 1))) >> SQUARE_BITS;
}

static uint16_t poc_sigma_um(const int32_t e_q4[BT_ELECTRODES], int weights, const int16_t poc_um[3],
                             uint32_t sigma_q8)
{
    const bool once = weights == BT_POC_WEIGHTS_COMPRESS_N1;
    const bool tip = poc_um[0] > 0;
    uint32_t weight[BT_ELECTRODES];
    bool counts[BT_ELECTRODES];
    uint32_t total = 0; // W: 19 weights of 24 bits
    for (int i = 0; i < BT_ELECTRODES; i++) {
        counts[i] = e_q4[i] < 0 || (e_q4[i] > 0 && weights == BT_POC_WEIGHTS_ABS_N2);
        uint32_t e = counts[i] ? (bt_abs32(e_q4[i]) + 8) >> 4 : 0;
        weight[i] = once ? e : e * e;
        total += weight[i];
    }
    int down = 0; // what weights are shifted by; even, because it is halved below
    while (total >> down >= 1u << WEIGHT_BITS) {
        down += 2;
    }
    const uint32_t half = (1u << down) >> 1;
    int32_t n_q15[3];
    for (int d = 0; d < 3; d++) {
        n_q15[d] = bt_with_sign((bt_abs32(poc_um[d]) * N_PER_UM_Q30 + (1u << 15)) >> 16, poc_um[d]);
    }
    if (!tip) {
        n_q15[0] = 0;
    }
    uint32_t along = 0;   // sum of w'^2 (x - c_x)^2, on the cylinder
    uint32_t across = 0;  // sum of w'^2 |r x n|^2; on the cylinder without x
    int32_t lever_q3 = 0; // sum of w r n
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (!counts[i]) {
            continue;
        }
        const int16_t *r = bt_electrode_um[i];
        const uint32_t w = (weight[i] + half) >> down;
        const uint32_t slope2 = once ? 1u << EQUAL_BITS : w; // w'^2; for squares a quarter of it
        int32_t out_q15 = r[1] * n_q15[1] + r[2] * n_q15[2];
        uint32_t off = square_of((r[1] * n_q15[2] - r[2] * n_q15[1]) >> 15);
        if (tip) {
            out_q15 += r[0] * n_q15[0];
            off += square_of((r[0] * n_q15[1] - r[1] * n_q15[0]) >> 15)
                   + square_of((r[0] * n_q15[2] - r[2] * n_q15[0]) >> 15);
        } else {
            along += slope2 * less_bits(square_of(r[0] - poc_um[0]));
        }
        across += slope2 * less_bits(off);
        lever_q3 += (int32_t)w * ((out_q15 + (1 << 11)) >> 12);
    }
    if (lever_q3 <= 0) { // all weights are 0, or too small to locate the contact
        return UNKNOWN;
    }
    const int slope_e = once ? (SQUARE_BITS - EQUAL_BITS) / 2 : SQUARE_BITS / 2 + 1 + down / 2;
    scaled sigma = scaled_of(sigma_q8, slope_e - 8);
    scaled along_um = ratio(product(root_of(along), sigma), scaled_of(total, 0));
    scaled across_um = ratio(product(product(root_of(across), sigma), scaled_of(BT_CORE_RADIUS_UM, 0)),
                             scaled_of((uint32_t)lever_q3, down - 3));
    return rounded(together(along_um, across_um));
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
    if (noise_count2 == 0) {
        return; // not measured yet
    }
    uint32_t sigma_q8 = bt_sigma_count_q8(noise_count2);
    if (msg->poc_um[0] != BT_INVALID_I16) {
        msg->poc_sigma_um = poc_sigma_um(e_q4, settings->poc_weights, msg->poc_um, sigma_q8);
    }
    bool forced = msg->force_100un[0] != BT_INVALID_I32;
    if (forced && settings->map == NULL && !settings->population) { // a map's does not come from noise
        force_sigma(settings, sigma_q8, msg);
    }
}
