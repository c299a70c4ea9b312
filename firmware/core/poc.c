#include "poc.h"

#include "fix.h"
#include "fold_gen.h"
#include "isqrt.h"

// Every electrode lies below the axis, so a positive weight sum keeps (y, z) away from 0: the
// direction below never is 0/0 (SPEC.md, Degenerate input), and |N_z| always is large enough to normalise by.
_Static_assert(BT_ELECTRODE_Z_MAX_UM < 0, "electrodes must have z < 0");
_Static_assert(BT_FOLD_HI_MAX <= INT32_MAX && BT_FOLD_LO_MAX <= INT32_MAX, "the folded sums must fit int32");
_Static_assert((BT_FOLD_HI_MAX << BT_FOLD_SPLIT_BITS) / BT_ELECTRODE_MAX_UM < 1LL << 31,
               "the weight sum must fit 31 bits");

#define RADIUS_UM_Q3   (8 * BT_CORE_RADIUS_UM)
#define DIRECTION_BITS 16 // a direction's components
#define RATIO_BITS     18 // of the divisor of x

_Static_assert((uint64_t)RADIUS_UM_Q3 << DIRECTION_BITS < 1ull << 32, "a scaled component must fit 32 bits");
_Static_assert(((uint64_t)BT_ELECTRODE_MAX_UM + 1) << RATIO_BITS < 1ull << 32,
               "the dividend of x must fit 32 bits");
_Static_assert(BT_FOLD_WEIGHT_BITS - 1 > RATIO_BITS
                   && BT_FOLD_WEIGHT_BITS + 5 - RATIO_BITS <= BT_FOLD_SPLIT_BITS,
               "the sums must shift down to the ratio, but not past their split");
// N_z alone is 1116 um times a weight sum of at least 2^23: the direction always has bits to drop.
_Static_assert(((int64_t)-BT_ELECTRODE_Z_MAX_UM << (BT_FOLD_WEIGHT_BITS - 1)) >> BT_FOLD_SPLIT_BITS
                   > 1LL << (DIRECTION_BITS + 1),
               "the direction must have more bits than it needs");

static int bit_length(uint32_t value)
{
    return value == 0 ? 0 : 32 - __builtin_clz(value);
}

// The weights of Eq 1 (before normalising); returns all of them ORed together.
static uint32_t weigh(const int32_t e_q4[BT_ELECTRODES], int weights, uint32_t w[BT_ELECTRODES])
{
    uint32_t all = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        // min(e, 0) without a branch. As unsigned, so that squares up to 2^32 - 1 are exact.
        uint32_t compressed = (uint32_t)(e_q4[i] & bt_shift_down(e_q4[i], 31));
        uint32_t e = weights == BT_POC_WEIGHTS_ABS_N2 ? (uint32_t)e_q4[i] : compressed;
        w[i] = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? 0 - compressed : e * e;
        all |= w[i];
    }
    return all;
}

// Bring the largest weight to exactly BT_FOLD_WEIGHT_BITS: only the ratios count from here on, and
// what is shifted out is below 2^-23 of the largest weight. Returns their sum.
static uint32_t normalise(uint32_t w[BT_ELECTRODES], uint32_t all)
{
    int down = bit_length(all) - BT_FOLD_WEIGHT_BITS;
    uint32_t total = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        w[i] = down > 0 ? w[i] >> down : w[i] << -down;
        total += w[i];
    }
    return total;
}

// The length of a direction whose components are below 2^16, to the nearest whole. Quarters of the
// squares are what fits 32 bits; the root's remainder gives the last bit back.
static uint32_t length_of(const uint32_t component[3])
{
    uint32_t quarter = 0;
    for (int d = 0; d < 3; d++) {
        quarter += component[d] * component[d] >> 2;
    }
    uint32_t root = bt_isqrt32(quarter);
    uint32_t rest = quarter - root * root; // root + rest / (2 root) is the square root
    return 2 * root + (2 * rest > root) + (2 * rest > 3 * root);
}

// The direction (hi, lo)[first..2] at length r, in 1/8 um, rounded down: whole um then round once.
static void to_radius(const bt_split_sums *sums, int first, int32_t out_q3[3])
{
    int32_t top[3] = {0, 0, 0};
    uint32_t component[3] = {0, 0, 0};
    uint32_t largest = 0;
    for (int d = first; d < 3; d++) {
        top[d] = bt_join(sums->hi[d], sums->lo[d], BT_FOLD_SPLIT_BITS, 1 << BT_FOLD_SPLIT_BITS);
        largest |= bt_abs32(top[d]);
    }
    int down = bit_length(largest) - DIRECTION_BITS;
    uint32_t half = 1u << (down - 1);
    for (int d = first; d < 3; d++) {
        uint32_t rounded = (bt_abs32(top[d]) + half) >> down;
        component[d] = rounded - (rounded >> DIRECTION_BITS); // 2^16 itself would not square
    }
    uint32_t length = length_of(component);
    for (int d = first; d < 3; d++) {
        out_q3[d] = bt_with_sign(BT_DIVIDE_U32(component[d] * RADIUS_UM_Q3, length), top[d]);
    }
}

static int16_t to_um(int32_t um_q3)
{
    return (int16_t)bt_with_sign((bt_abs32(um_q3) + 4) >> 3, um_q3);
}

// N_x / W on the cylinder, where N_x <= 0: both are brought to where W has RATIO_BITS.
static int16_t ratio_um(const bt_split_sums *sums, uint32_t total)
{
    int down = bit_length(total) - RATIO_BITS;
    uint32_t divisor = (total + (1u << (down - 1))) >> down;
    uint32_t high = (0 - (uint32_t)sums->hi[0]) << (BT_FOLD_SPLIT_BITS - down);
    uint32_t dividend = high - (uint32_t)bt_shift_down(sums->lo[0], down);
    return (int16_t)-(int32_t)bt_div_round_u32(dividend, divisor);
}

// The middle of what a value that was cut to 1/8 um may have been, in 1/16 um: cut values would pull
// the lever of torque x towards the axis, and that by more the larger the force.
static int32_t centre_q4(int32_t um_q3)
{
    return 2 * um_q3 + (um_q3 > 0) - (um_q3 < 0);
}

bool bt_poc(const int32_t e_q4[BT_ELECTRODES], int weights, bt_point *point)
{
    uint32_t w[BT_ELECTRODES];
    uint32_t all = weigh(e_q4, weights, w);
    if (all == 0) {
        return false;
    }
    uint32_t total = normalise(w, all);
    bt_split_sums sums;
    bt_fold_moments(w, &sums);
    int32_t fine[3] = {0, 0, 0};
    bool tip = sums.hi[0] + bt_shift_down(sums.lo[0], BT_FOLD_SPLIT_BITS) >= 0;
    if (tip) { // a point on the sphere; its direction needs no division by W
        to_radius(&sums, 0, fine);
        point->um[0] = to_um(fine[0]);
    } else { // cylinder: keep x, move (y, z) out to the radius, which the paper's Eq 2 leaves out
        to_radius(&sums, 1, fine);
        point->um[0] = ratio_um(&sums, total);
    }
    point->um[1] = to_um(fine[1]);
    point->um[2] = to_um(fine[2]);
    point->fine_yz_um_q4[0] = centre_q4(fine[1]);
    point->fine_yz_um_q4[1] = centre_q4(fine[2]);
    return true;
}
