#include "solve/poc.h"

#include "fixed_point.h"
#include "signal/sums_gen.h"
#include "solve/rsqrt.h"

// Every electrode has z < 0, so with a positive weight sum (y, z) cannot be 0: the direction below is never
// 0/0 (SPEC.md, Degenerate input), and |N_z| is always large enough to normalise by.
_Static_assert(BT_ELECTRODE_Z_MAX_UM < 0, "electrodes must have z < 0");

// The moments N = sum w r, whole or divided by 4 or 256 and truncated towards 0, so that they always fit
// int32. N_x is also held whole, modulo 2^32, which is enough to round N_x / W correctly.
typedef struct {
    int32_t n[3];
    int bits;            // n is N / 2^bits
    uint32_t x_backward; // -N_x whole, modulo 2^32
    uint32_t total;      // W
} moments;

#define LINEAR_BITS 2
#define SPLIT_BITS  8
#define QUARTER_X   (BT_SUMS_X_UNIT_UM / 4)

_Static_assert(BT_SUMS_X_UNIT_UM % 4 == 0, "a quarter of the unit of x must be whole");

// Weights with n = 1 are below 2^16. Up to this sum of weights every moment fits undivided.
#define WHOLE_TOTAL (INT32_MAX / BT_ELECTRODE_MAX_UM)

_Static_assert(-BT_ELECTRODE_Z_MAX_UM <= BT_ELECTRODE_MAX_UM, "x must be the longest coordinate");
_Static_assert((int64_t)BT_E_MAX_Q4 *BT_SUMS_AHEAD_UM <= INT32_MAX, "linear sums ahead must fit int32");
_Static_assert((int64_t)BT_E_MAX_Q4 * BT_SUMS_BEHIND_UNITS * QUARTER_X <= INT32_MAX,
               "a quarter of the linear sum behind must fit int32");
_Static_assert((int64_t)BT_E_MAX_Q4 *BT_SUMS_Y_UM <= INT32_MAX, "the linear sum of y must fit int32");
_Static_assert((int64_t)BT_E_MAX_Q4 *BT_SUMS_Z_UM <= UINT32_MAX, "the linear sum of z must fit uint32");

static void linear_moments(const bt_linear_sums *sums, moments *m)
{
    m->x_backward = BT_SUMS_X_UNIT_UM * sums->behind - sums->ahead;
    m->total = sums->total;
    if (sums->total <= WHOLE_TOTAL) {
        m->bits = 0;
        m->n[0] = -(int32_t)m->x_backward;
        m->n[1] = sums->y;
        m->n[2] = -(int32_t)sums->z;
    } else {
        m->bits = LINEAR_BITS;
        m->n[0] = (int32_t)(sums->ahead >> LINEAR_BITS) - (int32_t)(QUARTER_X * sums->behind);
        m->n[1] = sums->y / (1 << LINEAR_BITS);
        m->n[2] = -(int32_t)(sums->z >> LINEAR_BITS);
    }
}

// Squares are shifted so that the largest has exactly BT_SUMS_WEIGHT_BITS: only ratios count, and the bits
// shifted out are below 2^-21 of the largest.
#define WEIGHT_MAX ((1LL << BT_SUMS_WEIGHT_BITS) - 1)
#define LOW_BITS   (SPLIT_BITS - BT_SUMS_SPLIT_BITS) // still shifted out of the high sums

_Static_assert(WEIGHT_MAX *((BT_SUMS_AHEAD_UM >> BT_SUMS_SPLIT_BITS) + 1) <= INT32_MAX, "ahead must fit");
_Static_assert(WEIGHT_MAX *((BT_SUMS_Y_UM >> BT_SUMS_SPLIT_BITS) + 1) <= INT32_MAX, "y must fit int32");
_Static_assert(WEIGHT_MAX *((BT_SUMS_Z_UM >> BT_SUMS_SPLIT_BITS) + 1) <= UINT32_MAX, "z must fit uint32");
_Static_assert(WEIGHT_MAX *BT_SUMS_LOW_MAX <= INT32_MAX && WEIGHT_MAX * BT_SUMS_Y_LOW_MAX <= INT32_MAX,
               "the low parts must fit int32");
_Static_assert(WEIGHT_MAX * BT_SUMS_BEHIND_UNITS * BT_SUMS_X_UNIT_UM >> SPLIT_BITS <= INT32_MAX,
               "x behind the seam must fit int32 after the shift");
_Static_assert(WEIGHT_MAX *BT_SUMS_BEHIND_UNITS / 2 <= UINT32_MAX,
               "half of x behind the seam must fit uint32");
_Static_assert(LOW_BITS == 2 && BT_SUMS_X_UNIT_UM * 2 == QUARTER_X << (SPLIT_BITS - 5),
               "half the sum behind the seam times QUARTER_X must be 2^5 times the result");

// The squares of all signals, or of the compressed ones; return their bitwise OR. Unsigned, so that squares
// up to 2^32 - 1 are exact.
static uint32_t squares_of(const int32_t e_q4[BT_ELECTRODES], uint32_t w[BT_ELECTRODES])
{
    uint32_t all = 0;
    BT_UNROLL
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t e = (uint32_t)e_q4[i];
        w[i] = e * e;
        all |= w[i];
    }
    return all;
}

static uint32_t compressed_squares_of(const int32_t e_q4[BT_ELECTRODES], uint32_t w[BT_ELECTRODES])
{
    uint32_t all = 0;
    BT_UNROLL
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t e = (uint32_t)(e_q4[i] & bt_shift_down(e_q4[i], 31)); // min(e, 0) without a branch
        w[i] = e * e;
        all |= w[i];
    }
    return all;
}

static void square_moments(const int32_t e_q4[BT_ELECTRODES], int weights, moments *m)
{
    uint32_t w[BT_ELECTRODES];
    uint32_t all = weights == BT_POC_WEIGHTS_ABS_N2 ? squares_of(e_q4, w) : compressed_squares_of(e_q4, w);
    m->total = 0;
    if (all == 0) {
        return;
    }
    bt_split_sums sums;
    int down = bt_bit_length(all) - BT_SUMS_WEIGHT_BITS;
    bt_sums_split(w, down < 0 ? -down : 0, down < 0 ? 0 : down, &sums);
    uint32_t behind = sums.behind[0] + sums.behind[1];
    uint32_t half = (sums.behind[0] >> 1) + (sums.behind[1] >> 1);
    half = (half >> 5) * QUARTER_X + ((half & 31) * QUARTER_X >> 5);
    uint32_t ahead = (sums.ahead_hi << BT_SUMS_SPLIT_BITS) + sums.ahead_lo;
    m->x_backward = BT_SUMS_X_UNIT_UM * behind - ahead;
    m->total = sums.total;
    m->bits = SPLIT_BITS;
    m->n[0] = (int32_t)((sums.ahead_hi >> LOW_BITS) + (sums.ahead_lo >> SPLIT_BITS)) - (int32_t)half;
    m->n[1] = (sums.y_hi + sums.y_lo / (1 << BT_SUMS_SPLIT_BITS)) / (1 << LOW_BITS);
    m->n[2] = -(int32_t)((sums.z_hi >> LOW_BITS) + (sums.z_lo >> SPLIT_BITS));
}

// N_x / W on the cylinder, where N_x <= 0, correctly rounded. The quotient of the shifted values is less than
// 1.5 um off: W / 2^bits has at least 13 bits and is rounded to half a unit. The remainder then corrects it;
// it is small, so the modulo does not matter.
_Static_assert(WHOLE_TOTAL >> LINEAR_BITS >= 1 << 13 && BT_SUMS_WEIGHT_BITS - 1 - SPLIT_BITS >= 13
                   && BT_ELECTRODE_MAX_UM < 7 << 11,
               "13600 um of half a unit in 2^13 must stay below 0.9 um");
static int16_t ratio_um(const moments *m)
{
    uint32_t divisor = (m->total + (1u << m->bits >> 1)) >> m->bits;
    uint32_t um = bt_div_round_u32(bt_abs32(m->n[0]), divisor);
    int32_t rest = (int32_t)(m->x_backward - um * m->total);
    int32_t total = (int32_t)m->total;
    um += 2 * rest >= total;
    um -= 2 * rest < -total;
    return (int16_t)-(int32_t)um;
}

#define DIRECTION_BITS 16 // of a direction's components

_Static_assert(2001 * (int64_t)BT_CORE_RADIUS_UM < 4000LL * BT_ROOT_UM_FACTOR,
               "a component at the radius must stay below 2^32, even if the table is off by 2^-14");
_Static_assert(((int64_t)BT_ROOT_UM_FACTOR << 20) + (1 << BT_ROOT_UM_BITS) <= UINT32_MAX, "um must fit");
_Static_assert(((int64_t)BT_ROOT_LEVER_FACTOR << 17) + BT_ROOT_LEVER_FACTOR + (1 << BT_ROOT_LEVER_BITS)
                   <= UINT32_MAX,
               "the lever must fit");

// Scale the direction n[first..2] to the core's radius. The largest component is shifted to at least 2^15, so
// that a quarter of the squared length is at least 2^28.
static void to_radius(const int32_t n[3], int first, bt_point *point)
{
    uint32_t component[3];
    uint32_t largest = 0;
    for (int d = first; d < 3; d++) {
        component[d] = bt_abs32(n[d]);
        largest |= component[d];
    }
    int down = bt_bit_length(largest) - DIRECTION_BITS;
    uint32_t quarter = 0; // of the sum of squares, to fit 32 bits
    for (int d = first; d < 3; d++) {
        if (down > 0) {
            uint32_t rounded = (component[d] + (1u << (down - 1))) >> down;
            component[d] = rounded - (rounded >> DIRECTION_BITS); // the square of 2^16 would not fit
        } else {
            component[d] <<= -down;
        }
        quarter += component[d] * component[d] >> 2;
    }
    bool is_short = quarter < 1u << 30;
    uint32_t inverse = bt_root_inverse(is_short ? 4 * quarter : quarter);
    inverse = is_short ? inverse : (inverse + 1) >> 1;
    for (int d = first; d < 3; d++) {
        uint32_t at_radius = component[d] * inverse; // direction's component * BT_ROOT_SHARE * 2^32
        uint32_t um =
            ((at_radius >> 12) * BT_ROOT_UM_FACTOR + (1u << (BT_ROOT_UM_BITS - 1))) >> BT_ROOT_UM_BITS;
        point->um[d] = (int16_t)bt_with_sign(um, n[d]);
        if (d > 0) {
            // Round to the middle of the bits cut: truncation would pull the lever towards the axis.
            uint32_t middle = BT_ROOT_LEVER_FACTOR / 2 + (1u << (BT_ROOT_LEVER_BITS - 1));
            uint32_t lever = ((at_radius >> 15) * BT_ROOT_LEVER_FACTOR + middle) >> BT_ROOT_LEVER_BITS;
            point->lever_yz[d - 1] = bt_with_sign(lever, n[d]);
        }
    }
}

static bool point_of(const moments *m, bt_point *point)
{
    if (m->total == 0) {
        return false;
    }
    if (m->n[0] >= 0) { // tip: a point on the sphere; a direction needs no division by W
        to_radius(m->n, 0, point);
    } else { // cylinder: x stays, (y, z) move out to the radius, which the paper's Eq 2 omits
        to_radius(m->n, 1, point);
        point->um[0] = ratio_um(m);
    }
    return true;
}

static bool linear_point(const bt_linear_sums *sums, bt_point *point)
{
    moments m;
    linear_moments(sums, &m);
    return point_of(&m, point);
}

bool bt_poc(const int32_t e_q4[BT_ELECTRODES], int weights, bt_point *point)
{
    moments m;
    if (weights == BT_POC_WEIGHTS_COMPRESS_N1) {
        bt_linear_sums sums;
        bt_sums_linear(e_q4, &sums);
        return linear_point(&sums, point);
    }
    square_moments(e_q4, weights, &m);
    return point_of(&m, point);
}
