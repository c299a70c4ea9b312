// A map's sums, in 32-bit products. A column's value is a factor of 16 bits and a sign (conductances have 10
// finer bits besides); times a coefficient it is two products, one with either half, cut to 2^-16 of the
// whole.
#include "map/map.h"

#include "fixed_point.h"
#include "map/conductance.h"
#include "map/words.h"
#include "touch/signals.h"

// Each factor of a column times either half of a coefficient, or of a row's sum.
_Static_assert((int64_t)BT_MAP_FEATURE_MAX * 32768 <= INT32_MAX, "a factor times a half must fit int32");
_Static_assert(BT_E_MAX_Q4 <= BT_MAP_FEATURE_MAX && 1 << BT_MAP_ONE_Q <= BT_MAP_FEATURE_MAX
                   && BT_MAP_RATIO_MAX << (BT_MAP_CONDUCTANCE_Q - BT_MAP_FINE_BITS) <= BT_MAP_FEATURE_MAX,
               "signals, 1 and conductances must be factors");

// What bt_map_open sees to: the magnitudes of a row's coefficients, each with three products cut by one at
// most.
#define ROW_MAX    ((int64_t)BT_MAP_COEFFICIENT_SUM_MAX * BT_MAP_FEATURE_MAX / 65536 + 4 * BT_ELECTRODES)
#define BLOCK_MAX  (BT_ELECTRODES * (ROW_MAX * BT_MAP_FEATURE_MAX / 65536 + 2))
#define GATED_MAX  (BLOCK_MAX * BT_MAP_GATE_MAX / (1 << BT_MAP_GATE_Q) + 2)
#define RESULT_MAX ((int64_t)BT_MAP_RESULT_MAX << BT_MAP_RESULT_Q)
_Static_assert((int64_t)BT_ELECTRODES << (BT_MAP_FINE_BITS + 15) <= INT32_MAX, "fine sums must fit int32");
_Static_assert(ROW_MAX <= INT32_MAX - 32768, "a row must fit int32, and its halves int16");
_Static_assert(BLOCK_MAX < ((int64_t)1 << 62) / BT_MAP_GATE_MAX, "a block times its gate must fit int64");
_Static_assert(GATED_MAX < ((int64_t)1 << 62 >> BT_MAP_EXPONENT_MAX) / (BT_MAP_KINDS * BT_MAP_GATES),
               "the blocks' sum must fit int64");
_Static_assert(BT_MAP_RESULT_MAX < INT32_MAX, "a result must fit the message");

// high, or high * 2^FINE_BITS + fine.
typedef struct {
    const int32_t *high;
    const int32_t *fine; // NULL: none
} factors;

// What the blocks are made of, as far as the map needs it.
typedef struct {
    int32_t signal[BT_ELECTRODES];
    int32_t compression[BT_ELECTRODES];
    int32_t bulge[BT_ELECTRODES];
    int32_t conductance[BT_ELECTRODES];
    int32_t conductance_fine[BT_ELECTRODES];
    factors factors[BT_MAP_KINDS]; // of each kind
    int32_t single[BT_MAP_KINDS];  // the factor of a kind of one column
    int32_t gate[BT_MAP_GATES];
} features;

// ---- conductance ---------------------------------------------------------------------------------------

#define DIGIT_BITS 12

_Static_assert(BT_MAP_RATIO_MAX < 4 && 2 * DIGIT_BITS == BT_MAP_CONDUCTANCE_Q, "two digits must do");

// num / den in 2^-24, at most 1.15 units too small, for num < 4 den, both below 2^28. Two digits of a
// quotient by a divisor that is at most 2^-15 too large: each is at most 1 + 2^12 2^-15 too small, and what
// the first one leaves over goes into the second.
static uint32_t ratio_q24(uint32_t num, uint32_t den)
{
    uint32_t quotient = 0;
    while (den < 1u << 27) {
        den <<= 1;
        num <<= 1;
    }
    while (num >= den) {
        num -= den;
        quotient += 1u << 2 * DIGIT_BITS;
    }
    uint32_t divisor = (den >> DIGIT_BITS) + 1;
    uint32_t digit = BT_DIVIDE_U32(num, divisor);
    num = (num << DIGIT_BITS) - digit * den; // modulo 2^32, and below 2^29
    quotient += digit << DIGIT_BITS;
    quotient += BT_DIVIDE_U32(num, divisor);
    return quotient;
}

static int32_t conductance_q24(int32_t count, int32_t tare_q4)
{
    bt_conductance its = bt_conductance_of(count, tare_q4);
    if (its.num >= BT_MAP_RATIO_MAX * its.den) {
        return BT_MAP_RATIO_MAX << BT_MAP_CONDUCTANCE_Q; // a loss of conductance is never more than all of it
    }
    return bt_with_sign(ratio_q24(its.num, its.den), its.e_q4);
}

static void conductances(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                         int32_t high[BT_ELECTRODES], int32_t fine[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t u = 0;
        if (counts[i] != BT_INVALID_COUNT && tare_q4[i] != BT_INVALID_COUNT) {
            u = conductance_q24(counts[i], tare_q4[i]);
        }
        high[i] = bt_shift_down(u, BT_MAP_FINE_BITS);
        fine[i] = u & ((1 << BT_MAP_FINE_BITS) - 1);
    }
}

// ---- the compression's centroid ------------------------------------------------------------------------

#define UM_BITS     11 // a coordinate's fraction of a um
#define REACH_SHIFT 1
#define REACH(um)   ((((uint64_t)1 << (BT_MAP_GATE_Q - UM_BITS + 32 + REACH_SHIFT)) + (um) / 2) / (um))

_Static_assert(BT_ELECTRODES *(BT_E_MAX_Q4 + BT_MAP_FLOOR_Q4) < 1 << (32 - UM_BITS),
               "a remainder and the next digit must fit 32 bits");
_Static_assert((int64_t)(BT_E_MAX_Q4 + BT_MAP_FLOOR_Q4) * BT_ELECTRODE_MAX_UM <= INT32_MAX,
               "a term must fit");
_Static_assert(REACH(BT_MAP_REACH_X_UM) <= 1 << 30 && REACH(BT_MAP_REACH_Y_UM) <= 1 << 30,
               "must fit bt_scale");

// moment / weight over a reach, as a gate. |moment| <= BT_ELECTRODE_MAX_UM * weight.
static int32_t gate_of(int64_t moment, uint32_t weight, uint32_t reach)
{
    uint64_t magnitude = bt_abs(moment);
    uint32_t um = 0;
    uint32_t rest = (uint32_t)(magnitude >> UM_BITS);
    uint32_t low = (uint32_t)magnitude & ((1 << UM_BITS) - 1);
    for (int digit = 0; digit < 3; digit++) {
        uint32_t quotient = BT_DIVIDE_U32(rest, weight);
        um = (um << UM_BITS) + quotient;
        rest = ((rest - quotient * weight) << UM_BITS) + low;
        low = 0;
    }
    uint32_t gate = bt_scale(um, reach >> 16, reach & 0xFFFF, REACH_SHIFT);
    return moment < 0 ? -(int32_t)gate : (int32_t)gate;
}

static void gates(const int32_t e_q4[BT_ELECTRODES], int32_t gate[BT_MAP_GATES])
{
    uint32_t weight = 0;
    int64_t along = 0, across = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t w = BT_MAP_FLOOR_Q4 + (e_q4[i] < 0 ? -e_q4[i] : 0);
        weight += (uint32_t)w;
        along += w * bt_electrode_um[i][0];
        across += w * bt_electrode_um[i][1];
    }
    int32_t x = gate_of(along, weight, (uint32_t)REACH(BT_MAP_REACH_X_UM));
    int32_t y = gate_of(across, weight, (uint32_t)REACH(BT_MAP_REACH_Y_UM));
    gate[BT_MAP_GATE_X] = x;
    gate[BT_MAP_GATE_Y] = y;
    gate[BT_MAP_GATE_XX] = (int32_t)bt_shift_round((int64_t)x * x, BT_MAP_GATE_Q);
    gate[BT_MAP_GATE_XY] = (int32_t)bt_shift_round((int64_t)x * y, BT_MAP_GATE_Q);
    gate[BT_MAP_GATE_YY] = (int32_t)bt_shift_round((int64_t)y * y, BT_MAP_GATE_Q);
}

// ---- sums ----------------------------------------------------------------------------------------------

static inline int32_t product(int32_t factor, uint32_t word)
{
    return factor * bt_map_high(word) + bt_shift_down(factor * bt_map_low(word), 16);
}

// Sums over columns [from, BT_ELECTRODES) of factors times three axes' coefficients, in 2^-16 of their
// products. Each product is cut downwards, so that the sums begin at what that takes on average. Returns what
// is behind the coefficients. What is 0 costs little: of compression and bulge it is half.
static BT_NOINLINE const bt_map_word *high_row(const int32_t f[BT_ELECTRODES], int from,
                                               const bt_map_word *word, int32_t sum[3])
{
    int32_t x = (BT_ELECTRODES - from) / 2, y = x, z = x;
    for (int i = from; i < BT_ELECTRODES; i++, word += 3) {
        if (f[i] != 0) {
            x += product(f[i], word[0]);
            y += product(f[i], word[1]);
            z += product(f[i], word[2]);
        }
    }
    sum[0] = x;
    sum[1] = y;
    sum[2] = z;
    return word;
}

// What the fine bits add: times the high halves alone, the rest being below half a unit each.
static BT_NOINLINE void add_fine(const int32_t fine[BT_ELECTRODES], int from, const bt_map_word *word,
                                 int32_t sum[3])
{
    int32_t x = 0, y = 0, z = 0;
    for (int i = from; i < BT_ELECTRODES; i++, word += 3) {
        x += fine[i] * bt_map_high(word[0]);
        y += fine[i] * bt_map_high(word[1]);
        z += fine[i] * bt_map_high(word[2]);
    }
    sum[0] += bt_shift_down(x, BT_MAP_FINE_BITS);
    sum[1] += bt_shift_down(y, BT_MAP_FINE_BITS);
    sum[2] += bt_shift_down(z, BT_MAP_FINE_BITS);
}

static const bt_map_word *row(const factors *f, int from, const bt_map_word *word, int32_t sum[3])
{
    const bt_map_word *behind = high_row(f->high, from, word, sum);
    if (f->fine != NULL) {
        add_fine(f->fine, from, word, sum);
    }
    return behind;
}

// The same of one axis, whose words lie stride apart. So are torsion's rows summed, and the first factors of
// pairs times their rows' sums, which are split as a coefficient is and of which 64 bits come.
static BT_NOINLINE int64_t column(const factors *f, int from, const bt_map_word *word, int stride)
{
    int64_t high = 0;
    int32_t low = (BT_ELECTRODES - from) / 2;
    const bt_map_word *its = word;
    for (int i = from; i < BT_ELECTRODES; i++, its += stride) {
        high += f->high[i] * bt_map_high(*its);
        low += bt_shift_down(f->high[i] * bt_map_low(*its), 16);
    }
    if (f->fine != NULL) {
        int32_t fine = 0;
        for (int i = from; i < BT_ELECTRODES; i++, word += stride) {
            fine += f->fine[i] * bt_map_high(*word);
        }
        low += bt_shift_down(fine, BT_MAP_FINE_BITS);
    }
    return high + low;
}

static const bt_map_word *pairs(const factors *f, const bt_map_word *word, int64_t block[3])
{
    bt_map_word split[BT_ELECTRODES][3];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t sum[3];
        word = row(f, i, word, sum);
        split[i][0] = bt_map_word_of(sum[0]);
        split[i][1] = bt_map_word_of(sum[1]);
        split[i][2] = bt_map_word_of(sum[2]);
    }
    for (int d = 0; d < 3; d++) {
        block[d] = column(f, 0, &split[0][d], 3);
    }
    return word;
}

// A block's sums over three axes, in 2^-16 of its columns' and coefficients' products; behind its
// coefficients.
static const bt_map_word *block_sums(uint8_t kind, const features *of, const bt_map_word *word,
                                     int64_t block[3])
{
    int32_t sum[3];
    switch (bt_map_columns[kind]) {
    case BT_MAP_PAIRS:
        return pairs(&of->factors[kind], word, block);
    case BT_ELECTRODES:
        word = row(&of->factors[kind], 0, word, sum);
        break;
    default:
        for (int d = 0; d < 3; d++) {
            sum[d] = product(of->single[kind], *word++);
        }
        break;
    }
    for (int d = 0; d < 3; d++) {
        block[d] = sum[d];
    }
    return word;
}

static BT_NOINLINE int32_t result_of(int64_t total)
{
    total = total > RESULT_MAX ? RESULT_MAX : total < -RESULT_MAX ? -RESULT_MAX : total;
    return (int32_t)bt_shift_round(total, BT_MAP_RESULT_Q);
}

static void prepare(const bt_map *map, const uint16_t counts[BT_ELECTRODES],
                    const uint16_t tare_q4[BT_ELECTRODES], int32_t pdc_above_rest_q4, features *of)
{
    bt_signals_q4(counts, tare_q4, of->signal);
    if (map->kinds & (1u << BT_MAP_KIND_COMPRESSION | 1u << BT_MAP_KIND_BULGE)) {
        for (int i = 0; i < BT_ELECTRODES; i++) {
            of->compression[i] = of->signal[i] & bt_shift_down(of->signal[i], 31);
            of->bulge[i] = of->signal[i] - of->compression[i];
        }
    }
    if (map->kinds & (1u << BT_MAP_KIND_CONDUCTANCE | 1u << BT_MAP_KIND_CONDUCTANCE_PAIRS)) {
        conductances(counts, tare_q4, of->conductance, of->conductance_fine);
    }
    if (map->gates & ~(1u << BT_MAP_GATE_ONE)) {
        gates(of->signal, of->gate);
    }
    of->factors[BT_MAP_KIND_SIGNAL] = of->factors[BT_MAP_KIND_SIGNAL_PAIRS] = (factors){of->signal, NULL};
    of->factors[BT_MAP_KIND_COMPRESSION] = (factors){of->compression, NULL};
    of->factors[BT_MAP_KIND_BULGE] = (factors){of->bulge, NULL};
    of->factors[BT_MAP_KIND_CONDUCTANCE] = of->factors[BT_MAP_KIND_CONDUCTANCE_PAIRS] =
        (factors){of->conductance, of->conductance_fine};
    of->single[BT_MAP_KIND_OFFSET] = 1 << BT_MAP_ONE_Q;
    of->single[BT_MAP_KIND_PRESSURE] = bt_limited(pdc_above_rest_q4, -BT_MAP_FEATURE_MAX, BT_MAP_FEATURE_MAX);
}

// A block's sum of torsion, which is alone.
static int64_t torsion_sum(uint8_t kind, const features *of, const bt_map_word *word)
{
    bt_map_word split[BT_ELECTRODES];
    const factors *f = &of->factors[kind];
    switch (bt_map_columns[kind]) {
    case BT_MAP_PAIRS:
        for (int i = 0; i < BT_ELECTRODES; i++) {
            split[i] = bt_map_word_of((int32_t)column(f, i, word, 1));
            word += BT_ELECTRODES - i;
        }
        return column(f, 0, split, 1);
    case BT_ELECTRODES:
        return column(f, 0, word, 1);
    default:
        return product(of->single[kind], *word);
    }
}

static int64_t weighted(int64_t block, const uint8_t *head, int axis, const features *of)
{
    if (head[1] != BT_MAP_GATE_ONE) {
        block = bt_shift_round(block * of->gate[head[1]], BT_MAP_GATE_Q);
    }
    return (int64_t)((uint64_t)block << head[2 + axis]);
}

// In a pass of its own, so that maps without it do not pay for it.
static BT_NOINLINE int32_t torsion(const bt_map *map, const features *of)
{
    int64_t total = 0;
    const bt_map_word *word = bt_map_words(map);
    for (int b = 0; b < map->block_count; b++) {
        const uint8_t *head = map->blocks + b * BT_MAP_BLOCK_BYTES;
        word += BT_MAP_AXES_TORQUE * bt_map_columns[head[0]];
        total += weighted(torsion_sum(head[0], of, word), head, BT_MAP_AXES_TORQUE, of);
        word += bt_map_columns[head[0]];
    }
    return result_of(total);
}

void bt_map_wrench(const bt_map *map, const uint16_t counts[BT_ELECTRODES],
                   const uint16_t tare_q4[BT_ELECTRODES], int32_t pdc_above_rest_q4, int32_t force_100un[3],
                   int32_t *torque_mnmm, int32_t *torsion_mnmm)
{
    bool with_torque = map->axes > BT_MAP_AXES_FORCE && torque_mnmm != NULL;
    int axes = with_torque ? BT_MAP_AXES_TORQUE : BT_MAP_AXES_FORCE;
    int others = map->axes - axes;
    int64_t total[BT_MAP_AXES_TORQUE] = {0, 0, 0, 0, 0, 0};
    features of;
    bool possible = pdc_above_rest_q4 != BT_INVALID_I32 || !bt_map_needs_pdc(map);
    const bt_map_word *word = bt_map_words(map);
    if (possible) {
        prepare(map, counts, tare_q4, pdc_above_rest_q4, &of);
    }
    for (int b = 0; possible && b < map->block_count; b++) {
        const uint8_t *head = map->blocks + b * BT_MAP_BLOCK_BYTES;
        for (int axis = 0; axis < axes; axis += 3) {
            int64_t block[3];
            word = block_sums(head[0], &of, word, block);
            for (int d = 0; d < 3; d++) {
                total[axis + d] += weighted(block[d], head, axis + d, &of);
            }
        }
        if (others > 0) {
            word += others * bt_map_columns[head[0]];
        }
    }
    for (int d = 0; d < 3; d++) {
        force_100un[d] = possible ? result_of(total[d]) : BT_INVALID_I32;
        if (with_torque) {
            torque_mnmm[d] = possible ? result_of(total[3 + d]) : BT_INVALID_I32;
        }
    }
    if (with_torque && map->axes == BT_MAP_AXES_TORSION) {
        *torsion_mnmm = possible ? torsion(map, &of) : BT_INVALID_I32;
    }
}
