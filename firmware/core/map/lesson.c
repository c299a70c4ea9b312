#include "map/lesson.h"

#include "map/words.h"
#include "wire/little_endian.h"

_Static_assert(BT_LESSON_WEIGHT_AT + 2 * BT_LESSON_ROWS * BT_LESSON_FACTORS == BT_LESSON_BYTES
                   && BT_LESSON_BYTES % 4 == 0 && BT_LESSON_ROWS % 3 == 0 && BT_LESSON_FACTORS == BT_MAP_ROW,
               "the parts must fill it, and keep what follows aligned");

#define FORCE_MAX 1000000 // 100 N: a mixture need not fit beyond
_Static_assert((int64_t)FORCE_MAX *BT_LESSON_SCALE_MAX_Q8 <= INT32_MAX, "a scaled force must fit int32");
_Static_assert(8ll * FORCE_MAX * BT_LESSON_ALL <= INT32_MAX, "a mixture must fit int32");

#define DISTANCE_BITS 14 // of a row, in an eighth of the size: nothing changes further away
_Static_assert((int64_t)BT_LESSON_ROWS << 2 * DISTANCE_BITS <= UINT32_MAX, "a square must fit");

#define SIZE_BITS   13   // of the scaled size
#define LEAST_100UN 4096 // added to it: noise has no direction
#define SIZE_DOWN   10   // of the size, compared with the largest
_Static_assert(LEAST_100UN >> (SIZE_BITS - 1) == 1, "nothing is scaled up");
_Static_assert(3ll * BT_MAP_RESULT_MAX + LEAST_100UN <= INT32_MAX, "a size must fit int32");
_Static_assert(BT_MAP_GATE_Q == SIZE_BITS && BT_MAP_GATE_MAX <= BT_LESSON_FACTOR_MAX
                   && (int64_t)BT_MAP_GATE_MAX << SIZE_BITS <= INT32_MAX,
               "a gate must fit a factor");

#define ONE_Q8    256
#define NEAR_Q8   96   // of the square: the interval widens from here on
#define FAR_Q8    1280 // from here on none of the force is the map's
#define BEYOND_Q8 1536 // added by a size of twice the lesson's largest
_Static_assert((FAR_Q8 - ONE_Q8) >> 2 == BT_LESSON_ALL, "up to 1 all of the force must be the map's");
_Static_assert((3ll * BT_MAP_RESULT_MAX + LEAST_100UN) >> SIZE_DOWN <= UINT32_MAX / BEYOND_Q8, "must fit");

static uint32_t u16_at(const bt_map *map, int at)
{
    return bt_get_u16(map->lesson + at);
}

static int32_t cut(int32_t part, int down)
{
    return bt_clamp(bt_shift_down(part, down), -BT_LESSON_FACTOR_MAX, BT_LESSON_FACTOR_MAX);
}

uint32_t bt_lesson_factors(const int32_t force_100un[3], const bt_map_parts *parts,
                           int32_t factor[BT_LESSON_FACTORS])
{
    const uint32_t size =
        bt_abs32(force_100un[0]) + bt_abs32(force_100un[1]) + bt_abs32(force_100un[2]) + LEAST_100UN;
    const int down = bt_bit_length(size) - SIZE_BITS;
    const int32_t scaled = (int32_t)(size >> down);
    *factor++ = scaled;
    *factor++ = bt_shift_down(parts->x * scaled, BT_MAP_GATE_Q);
    *factor++ = bt_shift_down(parts->yy * scaled, BT_MAP_GATE_Q);
    *factor++ = bt_shift_down(parts->extent * scaled, BT_MAP_GATE_Q);
    for (int kind = 0; kind < 2; kind++) {
        BT_UNROLL
        for (int d = 0; d < 3; d++) {
            *factor++ = cut(parts->pairs_100un[kind][d], down);
        }
    }
    return size;
}

bt_lesson_verdict bt_lesson_judge(const bt_map *map, const int32_t force_100un[3], const bt_map_parts *parts)
{
    const bt_map_word *word = (const bt_map_word *)(const void *)(map->lesson + BT_LESSON_WEIGHT_AT);
    const int down = map->lesson[BT_LESSON_EXPONENT_AT];
    const uint32_t most = u16_at(map, BT_LESSON_SIZE_AT), least_z = map->lesson[BT_LESSON_Z_AT];
    int32_t factor[BT_LESSON_FACTORS], sum[3];
    const uint32_t size_100un = bt_lesson_factors(force_100un, parts, factor), size = size_100un >> SIZE_DOWN;
    uint32_t square = 0, bits = 0;
    for (int row = 0; row < BT_LESSON_ROWS; row += 3, word += 3 * BT_MAP_ROW_WORDS) {
        bt_map_row_of_3(factor, word, sum);
        for (int k = 0; k < 3; k++) {
            uint32_t off = bt_abs32(bt_shift_down(sum[k], down));
            bits |= off;
            square += off * off;
        }
    }
    if (bits >> DISTANCE_BITS != 0) {
        return (bt_lesson_verdict){.share = 0, .apart = BT_LESSON_ALL};
    }
    uint32_t unlike_q8 = square / ((uint32_t)(factor[0] * factor[0]) >> 14); // of eighths of the size
    unlike_q8 += bt_excess(size, most) * BEYOND_Q8 / most;
    const int32_t lacks_100un = (int32_t)(least_z * (size_100un >> 8)) - force_100un[2];
    unlike_q8 += least_z != 0 && lacks_100un > 0
                     ? (uint32_t)lacks_100un >> (bt_bit_length(size_100un) - SIZE_BITS)
                     : 0;
    return (bt_lesson_verdict){
        .share = bt_at_most(bt_excess(FAR_Q8, unlike_q8) >> 2, BT_LESSON_ALL),
        .apart = bt_at_most(bt_excess(unlike_q8, NEAR_Q8), BT_LESSON_ALL),
    };
}

uint32_t bt_lesson_shear_max_mn(const bt_map *map)
{
    return (uint32_t)map->lesson[BT_LESSON_SHEAR_AT] << 6;
}

uint32_t bt_lesson_counts_per_n(const bt_map *map)
{
    return map->lesson != NULL ? map->lesson[BT_LESSON_PRESSURE_AT] : 0;
}

void bt_lesson_margin(const bt_map *map, uint32_t apart, bt_margin *margin)
{
    for (int part = 0; part < 2; part++) {
        const uint32_t base_mn = map->margin.base_mn[part], share_q8 = map->margin.share_q8[part];
        const uint32_t more_mn = u16_at(map, BT_LESSON_MARGIN_AT + 4 * part) * apart >> 8;
        const uint32_t more_q8 = u16_at(map, BT_LESSON_MARGIN_AT + 4 * part + 2) * apart >> 8;
        const uint32_t most_mn = base_mn < BT_INVALID_COUNT ? BT_INVALID_COUNT - 1u : BT_INVALID_COUNT;
        margin->base_mn[part] = (uint16_t)bt_at_most(base_mn + more_mn, most_mn);
        margin->share_q8[part] = (uint16_t)bt_at_most(share_q8 + more_q8, BT_MARGIN_SHARE_MAX_Q8);
    }
}

uint32_t bt_lesson_guess_mn(const bt_map *map, uint32_t share, uint32_t guess_mn)
{
    return (guess_mn * u16_at(map, BT_LESSON_SCALE_AT) >> 8) * (BT_LESSON_ALL - share) >> 8;
}

void bt_lesson_mix(const bt_map *map, uint32_t share, const int32_t otherwise_100un[3],
                   int32_t force_100un[3])
{
    for (int d = 0; d < 3; d++) {
        int32_t other =
            bt_clamp(otherwise_100un[d], -FORCE_MAX, FORCE_MAX) * (int32_t)u16_at(map, BT_LESSON_SCALE_AT);
        int32_t own = bt_clamp(force_100un[d], -4 * FORCE_MAX, 4 * FORCE_MAX);
        other = bt_shift_down(other, 8);
        force_100un[d] = other + bt_shift_down((own - other) * (int32_t)share + BT_LESSON_ALL / 2, 8);
    }
}
