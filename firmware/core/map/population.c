#include "map/population.h"

#include "fixed_point.h"
#include "map/population_gen.h"
#include "signal/sums_gen.h"

// As bt_map_open would fill it in (tests/core/map/test_population.c): the build checks the map.
#define BLOCKS_AT ((const uint8_t *)bt_population_blob + BT_MAP_HEADER_BYTES)
const bt_map bt_population = {
    .axes = BT_MAP_AXES_FORCE,
    .block_count = BT_POPULATION_BLOCKS,
    .kinds = BT_POPULATION_KINDS,
    .gates = BT_POPULATION_GATES,
    .margin = BT_POPULATION_MARGIN,
    .serial = (const uint8_t *)bt_population_blob + 4,
    .blocks = BLOCKS_AT,
    .coefficients = BLOCKS_AT + BT_POPULATION_BLOCKS * BT_MAP_BLOCK_BYTES,
};
_Static_assert((BT_POPULATION_KINDS & ~(1 << BT_MAP_KIND_COMPRESSION | 1 << BT_MAP_KIND_BULGE)) == 0,
               "the map must read signals alone: it is given nothing else");

#define NOISE_Q4 (8 * 16)   // per electrode: not part of the touch
#define KNEE_Q4  (256 * 16) // above, a signal counts a quarter: one electrode must not dominate
#define MOST_Q4  (KNEE_Q4 + BT_E_MAX_Q4 / 4)

#define LEAST_Q4      (64 * 16) // sum: nothing touches below
#define LIGHT_Q4      (1500 * 16)
#define FIRM_BITS     14                // from LIGHT_Q4 + 2^FIRM_BITS on, all of the force is the map's
#define FEW_PRESSED   8                 // the share of the sum, 1/8, below which no direction is known
#define STRENGTH(sum) ((sum) * 25 >> 5) // 1.25 mN a count, of a firm touch
// A light touch has more counts per newton, as bulges come before compression: force goes with the square.
#define GAIN(sum)     ((uint32_t)bt_clamp((int32_t)((sum) * 13 >> 11), 102, BT_POPULATION_ALL))
#define UPRIGHT(sum)  ((sum) * (BT_CORE_RADIUS_UM / 32)) // noise alone must not set the direction
#define TO_BITS       13 // of the longest part of a direction, before the tilt
#define UNIT_BITS     12
#define NEAR_8        7  // in eighths of the strength: full share up to here,
#define FAR_8         11 // and none from here on
#define OUTSIDE       2  // strengths
#define STRENGTH_MAX  STRENGTH((int64_t)BT_ELECTRODES *MOST_Q4)

_Static_assert(MOST_Q4 *(int64_t)BT_SUMS_Z_UM + UPRIGHT((int64_t)BT_ELECTRODES * MOST_Q4) <= INT32_MAX
                   && BT_SUMS_AHEAD_UM < BT_SUMS_Z_UM && BT_SUMS_Y_UM < BT_SUMS_Z_UM,
               "a direction must fit int32");
_Static_assert((3 * 3 + 3 * 3 + 5 * 5ll) << 2 * TO_BITS <= UINT32_MAX, "a direction's square must fit");
_Static_assert(STRENGTH_MAX << UNIT_BITS <= INT32_MAX, "a force must fit int32");
_Static_assert(FAR_8 * STRENGTH_MAX * BT_POPULATION_ALL / (FAR_8 - NEAR_8) <= INT32_MAX,
               "a share must fit int32");
_Static_assert((8 + FAR_8) * STRENGTH_MAX / 8 * BT_POPULATION_ALL <= INT32_MAX, "a mixture must fit int32");
_Static_assert(BT_MAP_RESULT_MAX + STRENGTH_MAX <= INT32_MAX, "a difference must fit int32");

static inline uint32_t bounded(uint32_t size_q4)
{
    uint32_t size = size_q4 > NOISE_Q4 ? size_q4 - NOISE_Q4 : 0;
    return size > KNEE_Q4 ? KNEE_Q4 + ((size - KNEE_Q4) >> 2) : size;
}

// Along the outward normals of the compressed electrodes, with 0.6 of their tilt: 3 of 5 parts.
static void along_normals(const bt_linear_sums *pressed, uint32_t sum_q4, uint32_t strength_100un,
                          int32_t force_100un[3])
{
    // On the cylinder a normal has no x.
    const int32_t to[3] = {-(int32_t)pressed->ahead, -pressed->y, (int32_t)(pressed->z + UPRIGHT(sum_q4))};
    const int down = bt_bit_length(bt_abs32(to[0]) | bt_abs32(to[1]) | bt_abs32(to[2])) - TO_BITS;
    uint32_t size[3], square = 0;
    for (int d = 0; d < 3; d++) {
        size[d] = down > 0 ? bt_abs32(to[d]) >> down : bt_abs32(to[d]) << -down;
        size[d] *= d < 2 ? 3 : 5;
        square += size[d] * size[d];
    }
    const uint32_t per_length = (1u << 31) / bt_root_u32(square);
    for (int d = 0; d < 3; d++) {
        const uint32_t unit = size[d] * per_length >> (31 - UNIT_BITS);
        force_100un[d] = bt_with_sign(unit * strength_100un >> UNIT_BITS, to[d]);
    }
}

static uint32_t at_most(int32_t share)
{
    return (uint32_t)bt_clamp(share, 0, BT_POPULATION_ALL);
}

static uint32_t furthest(const int32_t a[3], const int32_t b[3])
{
    uint32_t most = 0;
    for (int d = 0; d < 3; d++) {
        uint32_t off = bt_abs32(a[d] - b[d]);
        most = off > most ? off : most;
    }
    return most;
}

static void mix(const bt_likeness *likeness, int32_t force_100un[3])
{
    int32_t part = (int32_t)(likeness->share * likeness->gain >> 8), rest = (int32_t)likeness->gain - part;
    for (int d = 0; d < 3; d++) {
        int32_t by_map = part > 0 ? force_100un[d] * part : 0; // far off, it need not fit
        int32_t sum = by_map + likeness->otherwise_100un[d] * rest;
        force_100un[d] = bt_with_sign((bt_abs32(sum) + BT_POPULATION_ALL / 2) >> 8, sum);
    }
}

bool bt_population_like(const bt_map *map)
{
    return map->axes == BT_MAP_AXES_FORCE && map->block_count == BT_POPULATION_BLOCKS
           && map->kinds == BT_POPULATION_KINDS && map->gates == BT_POPULATION_GATES;
}

bt_likeness bt_population_touch(const int32_t e_q4[BT_ELECTRODES])
{
    int32_t x_q4[BT_ELECTRODES];
    uint32_t sum_q4 = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t size = bounded(bt_abs32(e_q4[i]));
        sum_q4 += size;
        x_q4[i] = bt_with_sign(size, e_q4[i]);
    }
    bt_likeness touch = {.outside = sum_q4 < LEAST_Q4, .gain = GAIN(sum_q4), .firm_100un = STRENGTH(sum_q4)};
    touch.strength_100un = touch.firm_100un * touch.gain >> 8;
    if (sum_q4 > 0) {
        bt_linear_sums pressed;
        bt_sums_linear(x_q4, &pressed);
        along_normals(&pressed, sum_q4, touch.firm_100un, touch.otherwise_100un);
        touch.share = at_most(bt_shift_down((int32_t)sum_q4 - LIGHT_Q4, FIRM_BITS - 8));
        touch.few = FEW_PRESSED * pressed.total < sum_q4;
        touch.outside |= touch.few;
    }
    return touch;
}

void bt_population_judge(bt_likeness *touch, uint32_t off_100un)
{
    const uint32_t firm_100un = touch->firm_100un, far = FAR_8 * firm_100un;
    touch->off_100un = off_100un < firm_100un ? off_100un : firm_100un;
    if (off_100un < far / 8) {
        uint32_t share = (far - 8 * off_100un) * (BT_POPULATION_ALL / (FAR_8 - NEAR_8)) / firm_100un;
        touch->share = share < touch->share ? share : touch->share;
    } else {
        touch->share = 0;
    }
    touch->outside = off_100un > OUTSIDE * firm_100un || (touch->share < BT_POPULATION_ALL && touch->few);
}

bt_likeness bt_population_force(const bt_map *map, const int32_t e_q4[BT_ELECTRODES], int32_t force_100un[3])
{
    bt_likeness touch = bt_population_touch(e_q4);
    if (touch.share > 0) { // else nothing of the map would be published
        bt_map_results(map, e_q4, NULL, NULL, 0, BT_MAP_AXES_FORCE, force_100un, NULL);
        bt_population_judge(&touch, furthest(force_100un, touch.otherwise_100un));
    }
    if (touch.share < BT_POPULATION_ALL || touch.gain < BT_POPULATION_ALL) {
        mix(&touch, force_100un);
    }
    return touch;
}

uint32_t bt_strength_100un(const int32_t e_q4[BT_ELECTRODES])
{
    uint32_t sum_q4 = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum_q4 += bounded(bt_abs32(e_q4[i]));
    }
    return STRENGTH(sum_q4);
}
