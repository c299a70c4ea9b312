#include "map/population.h"

#include "fixed_point.h"
#include "map/population_gen.h"

// As bt_map_open would fill it in (tests/core/map/test_population.c): the map is checked when it is built.
#define BLOCKS_AT ((const uint8_t *)bt_population_blob + BT_MAP_HEADER_BYTES)
const bt_map bt_population = {
    .axes = BT_MAP_AXES_FORCE,
    .block_count = BT_POPULATION_BLOCKS,
    .kinds = BT_POPULATION_KINDS,
    .gates = BT_POPULATION_GATES,
    .serial = (const uint8_t *)bt_population_blob + 4,
    .blocks = BLOCKS_AT,
    .coefficients = BLOCKS_AT + BT_POPULATION_BLOCKS * BT_MAP_BLOCK_BYTES,
};

void bt_population_force(const int32_t e_q4[BT_ELECTRODES], const uint16_t counts[BT_ELECTRODES],
                         const uint16_t tare_q4[BT_ELECTRODES], int32_t force_100un[3])
{
    bt_map_results(&bt_population, e_q4, counts, tare_q4, 0, BT_MAP_AXES_FORCE, force_100un);
}

// ---- is the frame like those that the map was trained on ------------------------------------------------

#define NOISE_Q4 (8 * 16)   // per electrode: not part of the pattern
#define KNEE_Q4  (256 * 16) // above, a signal counts a quarter: one electrode must not be all of the pattern
#define MOST_Q4  (KNEE_Q4 + BT_E_MAX_Q4 / 4)
#define SUM_BITS 14   // what the pattern's sum is shifted to
#define ROW_CUT  15   // of a row of the distance
#define ENERGY_CUT 13 // weights are in 2^-11: twice 15 - 11, and 5 of the result

#define LEAST_Q4      (64 * 16) // in sum: below, nothing touches
#define LIGHT_Q4      (1500 * 16)
#define FIRM_BITS     14       // the map makes all of the force from LIGHT_Q4 + 2^FIRM_BITS on
#define NEAR_Q5       (4 << 5) // squared distance up to which it does,
#define FAR_Q5        (8 << 5) // and from which on it makes nothing
#define OUTSIDE_Q5    (48 << 5)
#define FEW_PRESSED   8                 // the share of the pattern, 1/8, below which no direction is known
#define STRENGTH(sum) ((sum) * 25 >> 5) // 1.25 mN a count
#define UPRIGHT(sum)  ((sum) * (BT_CORE_RADIUS_UM / 32)) // keeps the direction from being that of noise
#define UNIT_BITS     12

_Static_assert(19ll * (BT_POPULATION_PATTERN_MAX / 2 + 1) * (BT_POPULATION_PATTERN_MAX / 2 + 1) <= UINT32_MAX
                   && (int64_t)BT_POPULATION_PATTERN_MAX << SUM_BITS <= INT32_MAX && ROW_CUT == SUM_BITS + 1,
               "rows, and the sum of their squares, must fit");
_Static_assert((5ll * BT_ELECTRODE_MAX_UM << SUM_BITS) <= INT32_MAX, "a direction must fit int32");
_Static_assert(STRENGTH((int64_t)BT_ELECTRODES *MOST_Q4) << UNIT_BITS <= INT32_MAX, "a force must fit int32");

// A frame's bounded signals, shifted so that their sum has SUM_BITS, all positive; in sum_q4 they are not.
typedef struct {
    int32_t x[BT_ELECTRODES];
    uint32_t sum_q4, pressed_q4, sum;
} pattern;

static pattern pattern_of(const int32_t e_q4[BT_ELECTRODES])
{
    pattern of = {.sum_q4 = 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t size = bt_abs32(e_q4[i]);
        size = size > NOISE_Q4 ? size - NOISE_Q4 : 0;
        size = size > KNEE_Q4 ? KNEE_Q4 + ((size - KNEE_Q4) >> 2) : size;
        of.sum_q4 += size;
        of.pressed_q4 += e_q4[i] < 0 ? size : 0;
        of.x[i] = bt_with_sign(size, e_q4[i]);
    }
    int up = SUM_BITS - bt_bit_length(of.sum_q4);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t size = bt_abs32(of.x[i]);
        size = up > 0 ? size << up : size >> -up;
        of.sum += size;
        of.x[i] = bt_with_sign(size, of.x[i]);
    }
    return of;
}

// The squared Mahalanobis distance from the training's patterns, per electrode, of the pattern as a unit
// vector. The training is mirror-symmetric, so what differs between left and right has rows of its own.
static uint32_t distance_q5(const pattern *of)
{
    static const uint8_t pair[BT_POPULATION_PAIRS][2] = BT_POPULATION_PAIR;
    static const uint8_t middle[BT_ELECTRODES - 2 * BT_POPULATION_PAIRS] = BT_POPULATION_MIDDLE;
    static const int16_t weight[] = BT_POPULATION_PATTERN;
    const int16_t *w = weight;
    int32_t part[BT_ELECTRODES];
    uint32_t energy = 0, square = 0;
    for (int k = 0; k < BT_POPULATION_PAIRS; k++) {
        int32_t left = of->x[pair[k][0]], right = of->x[pair[k][1]];
        part[k] = left - right;
        part[BT_POPULATION_PAIRS + k] = left + right;
        energy += (uint32_t)(left * left) + (uint32_t)(right * right);
    }
    for (int k = 0; k < BT_ELECTRODES - 2 * BT_POPULATION_PAIRS; k++) {
        int32_t x = of->x[middle[k]];
        part[2 * BT_POPULATION_PAIRS + k] = x;
        energy += (uint32_t)(x * x);
    }
    for (int k = 0; k < BT_ELECTRODES; k++) {
        int32_t row = 0;
        int end = k < BT_POPULATION_PAIRS ? BT_POPULATION_PAIRS : BT_ELECTRODES;
        for (int i = k; i < end; i++) {
            row += *w++ * part[i];
        }
        row = bt_shift_down(row, ROW_CUT);
        square += (uint32_t)(row * row);
    }
    return BT_DIVIDE_U32(square, energy >> ENERGY_CUT);
}

// Along the outward normals of the compressed electrodes, with BT_POPULATION_TILT of their tilt.
static void along_normals(const pattern *of, uint32_t strength_100un, int32_t force_100un[3])
{
    int32_t to[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t x = of->x[i] & bt_shift_down(of->x[i], 31);
        const int16_t *r = bt_electrode_um[i];
        to[0] += x * (r[0] > 0 ? r[0] : 0); // on the cylinder a normal has no x
        to[1] += x * r[1];
        to[2] += x * r[2];
    }
    to[0] *= 3; // of 5: the tilt is .6
    to[1] *= 3;
    to[2] = 5 * to[2] + 5 * (int32_t)UPRIGHT(of->sum);
    int down = bt_bit_length(bt_abs32(to[0]) | bt_abs32(to[1]) | bt_abs32(to[2])) - 15;
    uint32_t size[3], square = 0;
    for (int d = 0; d < 3; d++) {
        size[d] = bt_abs32(to[d]) >> down;
        square += size[d] * size[d];
    }
    uint32_t length = bt_root_u32(square);
    for (int d = 0; d < 3; d++) {
        uint32_t unit = BT_DIVIDE_U32(size[d] << UNIT_BITS, length);
        force_100un[d] = bt_with_sign(unit * strength_100un >> UNIT_BITS, to[d]);
    }
}

static uint32_t at_most(int32_t share)
{
    return (uint32_t)bt_clamp(share, 0, BT_POPULATION_ALL);
}

bt_likeness bt_population_likeness(const int32_t e_q4[BT_ELECTRODES])
{
    pattern of = pattern_of(e_q4);
    bt_likeness its = {.outside = of.sum_q4 < LEAST_Q4, .strength_100un = STRENGTH(of.sum_q4)};
    if (of.sum_q4 == 0) {
        return its;
    }
    uint32_t far_q5 = distance_q5(&of);
    uint32_t like = at_most(((int32_t)FAR_Q5 - (int32_t)(far_q5 < FAR_Q5 ? far_q5 : FAR_Q5)) * 2);
    uint32_t firm = at_most(bt_shift_down((int32_t)of.sum_q4 - LIGHT_Q4, FIRM_BITS - 8));
    its.share = like < firm ? like : firm;
    its.outside |= far_q5 > OUTSIDE_Q5 || (far_q5 > NEAR_Q5 && FEW_PRESSED * of.pressed_q4 < of.sum_q4);
    if (its.share < BT_POPULATION_ALL) {
        along_normals(&of, its.strength_100un, its.otherwise_100un);
    }
    return its;
}

void bt_population_mix(const bt_likeness *its, int32_t force_100un[3])
{
    for (int d = 0; d < 3; d++) {
        int64_t sum = (int64_t)force_100un[d] * (int32_t)its->share
                      + (int64_t)its->otherwise_100un[d] * (int32_t)(BT_POPULATION_ALL - its->share);
        force_100un[d] = (int32_t)bt_shift_round(sum, 8);
    }
}

// Away from the training: .15 of the strength across, .3 along z, by which left-out fingers and rigs were
// off.
void bt_population_sigma(const bt_likeness *its, uint16_t sigma_100un[3])
{
    static const uint16_t trained[3] = BT_POPULATION_SIGMA_100UN;
    uint32_t across = its->strength_100un * 3 / 20;
    for (int d = 0; d < 3; d++) {
        uint32_t away = d < 2 ? across : 2 * across;
        sigma_100un[d] = (uint16_t)((trained[d] * its->share + away * (BT_POPULATION_ALL - its->share)) >> 8);
    }
}
