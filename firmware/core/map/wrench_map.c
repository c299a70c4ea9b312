// Evaluates a map: 16-bit factors and coefficients, 32-bit sums.
#include "map/factor_limits.h"
#include "map/map.h"
#include "map/words.h"
#include "signal/signals.h"

// bt_map_open makes sure that the sums of rows, pairs, blocks and all blocks stay within INT32_MAX, rounding
// included. The following bounds do not depend on coefficients.
_Static_assert(((INT32_MAX >> BT_MAP_GATE_CUT) + (int64_t)1) * BT_MAP_GATE_MAX
                       + (1 << (BT_MAP_EXPONENT_MAX - 1))
                   <= INT32_MAX,
               "a block times its gate must fit int32");
_Static_assert(BT_MAP_RESULT_MAX < INT32_MAX, "a result must fit the message");
_Static_assert(BT_E_MAX_Q4 >> (4 - BT_MAP_SIGNAL_Q) == BT_MAP_SIGNAL_MAX, "a signal must be a factor");

// A factor for each electrode, then the first ones again, for pairs that wrap around the ring.
#define RING (BT_ELECTRODES + BT_MAP_ROW - 1)

typedef struct {
    int32_t signal[RING];
    int32_t compression[BT_MAP_LINE_COEFFICIENTS]; // the last one is 0
    int32_t bulge[BT_MAP_LINE_COEFFICIENTS];
    int32_t conductance[RING];
    int32_t unity, pressure;
    int32_t gate[BT_MAP_GATES];
} features;

static const uint16_t factors_at[BT_MAP_KINDS] = {
    [BT_MAP_KIND_OFFSET] = offsetof(features, unity),
    [BT_MAP_KIND_SIGNAL] = offsetof(features, signal),
    [BT_MAP_KIND_COMPRESSION] = offsetof(features, compression),
    [BT_MAP_KIND_BULGE] = offsetof(features, bulge),
    [BT_MAP_KIND_SIGNAL_PAIRS] = offsetof(features, signal),
    [BT_MAP_KIND_CONDUCTANCE] = offsetof(features, conductance),
    [BT_MAP_KIND_CONDUCTANCE_PAIRS] = offsetof(features, conductance),
    [BT_MAP_KIND_PRESSURE] = offsetof(features, pressure),
};

// Rounds half up. Adding 1 before the last bit is shifted out needs no constant, and cannot overflow.
static int32_t rounded(int32_t value, int bits)
{
    return bt_shift_down(bt_shift_down(value, bits - 1) + 1, 1);
}

static void close_ring(int32_t f[RING])
{
    for (int i = BT_ELECTRODES; i < RING; i++) {
        f[i] = f[i - BT_ELECTRODES];
    }
}

// ---- factors -------------------------------------------------------------------------------------------

#define FLOOR      (BT_MAP_FLOOR_Q4 >> (4 - BT_MAP_SIGNAL_Q))
#define MOMENT_MAX ((int64_t)(BT_MAP_SIGNAL_MAX + FLOOR) * BT_MAP_PLACE_SUM)
#define GATE_SHIFT (BT_MAP_GATE_Q - BT_MAP_PLACE_Q)
_Static_assert((MOMENT_MAX << GATE_SHIFT) + BT_ELECTRODES * (BT_MAP_SIGNAL_MAX + FLOOR) <= INT32_MAX,
               "a moment must fit int32");
_Static_assert(((int64_t)(BT_MAP_SIGNAL_MAX + FLOOR) * BT_MAP_SQUARE_SUM << GATE_SHIFT)
                       + BT_ELECTRODES * (BT_MAP_SIGNAL_MAX + FLOOR)
                   <= UINT32_MAX,
               "a second moment must fit uint32");
_Static_assert((int64_t)BT_MAP_GATE_MAX *BT_MAP_GATE_MAX <= INT32_MAX, "a gate's square must fit int32");

static const int16_t place[BT_ELECTRODES][2] = BT_MAP_PLACES;

// Moments of the compressions. FLOOR is added to each weight, so that noise alone cannot move the centroid
// far.
typedef struct {
    int32_t weight, along, across;
} moments;

static moments signals(const int32_t e_q4[BT_ELECTRODES], features *inputs)
{
    moments sum = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t e = rounded(e_q4[i], 4 - BT_MAP_SIGNAL_Q);
        int32_t compression = e & bt_shift_down(e, 31);
        int32_t w = FLOOR - compression;
        inputs->signal[i] = e;
        inputs->compression[i] = compression;
        inputs->bulge[i] = e - compression;
        sum.weight += w;
        sum.along += w * place[i][0];
        sum.across += w * place[i][1];
    }
    inputs->compression[BT_ELECTRODES] = inputs->bulge[BT_ELECTRODES] = 0;
    return sum;
}

static BT_NOINLINE int32_t any_conductance(int32_t count, int32_t tare_q4)
{
    return bt_conductance_limited(count, tare_q4);
}

static void conductances(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                         int32_t u[RING])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t count = counts[i], rest_q4 = tare_q4[i];
        bool plain = bt_is_plain((uint32_t)count, (uint32_t)rest_q4);
        u[i] = plain ? bt_conductance_plain(count, rest_q4) : any_conductance(count, rest_q4);
    }
    close_ring(u);
}

static int32_t gate_of(int32_t moment, int32_t weight)
{
    return bt_with_sign(bt_div_round_u32(bt_abs32(moment) << GATE_SHIFT, (uint32_t)weight), moment);
}

// The compressions' centroid, as a share of the reach, and the products of the coordinates.
static void gates(const moments *pressed, int32_t gate[BT_MAP_GATES])
{
    int32_t x = gate_of(pressed->along, pressed->weight);
    int32_t y = gate_of(pressed->across, pressed->weight);
    gate[BT_MAP_GATE_X] = x;
    gate[BT_MAP_GATE_Y] = y;
    gate[BT_MAP_GATE_XX] = rounded(x * x, BT_MAP_GATE_Q);
    gate[BT_MAP_GATE_XY] = rounded(x * y, BT_MAP_GATE_Q);
    gate[BT_MAP_GATE_YY] = rounded(y * y, BT_MAP_GATE_Q);
}

static moments prepare(const bt_map *map, const int32_t e_q4[BT_ELECTRODES],
                       const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                       int32_t pdc_above_rest_q4, bool gated, features *inputs)
{
    const moments compression = signals(e_q4, inputs);
    if (map->kinds & (1u << BT_MAP_KIND_SIGNAL | 1u << BT_MAP_KIND_SIGNAL_PAIRS)) {
        close_ring(inputs->signal);
    }
    if (map->kinds & (1u << BT_MAP_KIND_CONDUCTANCE | 1u << BT_MAP_KIND_CONDUCTANCE_PAIRS)) {
        conductances(counts, tare_q4, inputs->conductance);
    }
    if (gated || map->gates & ~(1u << BT_MAP_GATE_ONE)) {
        gates(&compression, inputs->gate);
    }
    inputs->unity = 1 << BT_MAP_ONE_Q;
    inputs->pressure =
        bt_shift_down(bt_clamp(pdc_above_rest_q4, -BT_E_MAX_Q4, BT_E_MAX_Q4), 4 - BT_MAP_PRESSURE_Q);
    return compression;
}

// ---- sums ----------------------------------------------------------------------------------------------

// Add a row's products to the sums of `width` axes. The axes' coefficients lie side by side, so two columns
// are as many words as axes. All of this is inlined for each width; in this order, only one factor, one word
// and the sums need a register.
static inline void add_row(const int32_t f[BT_MAP_ROW], const bt_map_word *word, int width, int32_t sum[])
{
    BT_UNROLL
    for (int k = 0; k < BT_MAP_ROW; k += 2) {
        int32_t factor = f[k];
        BT_UNROLL
        for (int h = 0; h < 2 * width; h += 2) {
            uint32_t both = *word++;
            if (h == width) {
                factor = f[k + 1];
            }
            sum[h % width] += factor * bt_map_first(both);
            if (h + 1 == width) {
                factor = f[k + 1];
            }
            sum[(h + 1) % width] += factor * bt_map_second(both);
        }
    }
}

// A local array holds the sums: the compiler must assume that a write through `sum` changes a word.
static inline void line(const int32_t f[BT_MAP_LINE_COEFFICIENTS], const bt_map_word *word, int width,
                        int32_t sum[])
{
    int32_t local[BT_MAP_GROUP_MAX] = {0, 0, 0, 0};
    for (int half = 0; half < 2; half++, f += BT_MAP_ROW, word += width * BT_MAP_ROW_WORDS) {
        add_row(f, word, width, local);
    }
    for (int a = 0; a < width; a++) {
        sum[a] = local[a];
    }
}

// A row's sum times the common factor of the products, divided by 2^ROW_CUT, in two 16-bit products.
static inline int32_t cut_product(int32_t row, int32_t factor)
{
    return bt_shift_down(row, 16) * factor + bt_shift_down((int32_t)(uint16_t)row * factor, 16);
}

_Static_assert(BT_MAP_ROW_CUT == 16 && BT_CONDUCTANCE_MAX <= INT32_MAX / UINT16_MAX
                   && BT_MAP_SIGNAL_MAX <= INT32_MAX / UINT16_MAX,
               "a low half times a factor must fit int32");

// Row by row. Here totals in `sum` are faster than in a local array.
static inline void pairs(const int32_t f[RING], const bt_map_word *word, int width, int32_t sum[])
{
    for (int a = 0; a < width; a++) {
        sum[a] = 0;
    }
    for (const int32_t *end = f + BT_ELECTRODES; f != end; f++, word += width * BT_MAP_ROW_WORDS) {
        int32_t row[BT_MAP_GROUP_MAX] = {0, 0, 0, 0};
        add_row(f, word, width, row);
        for (int a = 0; a < width; a++) {
            sum[a] += cut_product(row[a], *f);
        }
    }
}

static BT_NOINLINE void line_of_3(const int32_t *f, const bt_map_word *word, int32_t sum[])
{
    line(f, word, 3, sum);
}

static BT_NOINLINE void line_of_4(const int32_t *f, const bt_map_word *word, int32_t sum[])
{
    line(f, word, 4, sum);
}

void bt_map_row_of_3(const int32_t f[BT_MAP_ROW], const bt_map_word *word, int32_t sum[3])
{
    int32_t local[3] = {0, 0, 0};
    add_row(f, word, 3, local);
    sum[0] = local[0];
    sum[1] = local[1];
    sum[2] = local[2];
}

static BT_NOINLINE void pairs_of_3(const int32_t *f, const bt_map_word *word, int32_t sum[])
{
    pairs(f, word, 3, sum);
}

static BT_NOINLINE void pairs_of_4(const int32_t *f, const bt_map_word *word, int32_t sum[])
{
    pairs(f, word, 4, sum);
}

// For a kind with a single column.
static void single(int32_t factor, const bt_map_word *word, int width, int32_t sum[])
{
    const bt_map_coefficient *coefficient = (const bt_map_coefficient *)word;
    for (int a = 0; a < width; a++) {
        sum[a] = factor * coefficient[a];
    }
}

// Add a block to the totals of `width` axes from `axis` on.
static inline void add_block(const uint8_t *head, const features *inputs, const bt_map_word *word, int axis,
                             int width, int32_t total[BT_MAP_AXES_MAX])
{
    int32_t sum[BT_MAP_GROUP_MAX];
    const int32_t *f = (const int32_t *)(const void *)((const char *)inputs + factors_at[head[0]]);
    switch (bt_map_coefficients[head[0]]) {
    case BT_MAP_PAIR_COEFFICIENTS:
        (width == 3 ? pairs_of_3 : pairs_of_4)(f, word, sum);
        break;
    case BT_MAP_LINE_COEFFICIENTS:
        (width == 3 ? line_of_3 : line_of_4)(f, word, sum);
        break;
    default:
        single(*f, word, width, sum);
        break;
    }
    if (head[1] != BT_MAP_GATE_ONE) {
        int32_t gate = inputs->gate[head[1]];
        BT_UNROLL
        for (int a = 0; a < width; a++) {
            sum[a] = rounded(sum[a], BT_MAP_GATE_CUT) * gate;
        }
    }
    BT_UNROLL
    for (int a = 0; a < width; a++) {
        total[axis + a] += rounded(sum[a], head[2 + axis + a]);
    }
}

// A part is the growth of the totals.
static int32_t *part_of(bt_map_parts *parts, uint8_t kind)
{
    return parts == NULL ? NULL : parts->pairs_100un[kind == BT_MAP_KIND_CONDUCTANCE_PAIRS];
}

static void add_to_part(int32_t *part, const int32_t total[3], int32_t sign)
{
    for (int d = 0; part != NULL && d < 3; d++) {
        part[d] += sign * total[d];
    }
}

// The compressions' second moment along, less half of the centroid's square.
static int32_t extent_of(const features *inputs, int32_t weight)
{
    uint32_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t square = place[i][0] * place[i][0] >> BT_MAP_PLACE_Q;
        sum += (uint32_t)((FLOOR - inputs->compression[i]) * square);
    }
    uint32_t moment = bt_div_round_u32(sum << GATE_SHIFT, (uint32_t)weight);
    return (int32_t)moment - bt_shift_down(inputs->gate[BT_MAP_GATE_XX], 1);
}

// Field by field, which spares calls of memset and memcpy.
static void begin_parts(bt_map_parts *parts, const features *inputs, int32_t weight)
{
    int32_t *first = parts->pairs_100un[0], *second = parts->pairs_100un[1];
    first[0] = first[1] = first[2] = second[0] = second[1] = second[2] = 0;
    parts->x = inputs->gate[BT_MAP_GATE_X];
    parts->yy = inputs->gate[BT_MAP_GATE_YY];
    parts->extent = extent_of(inputs, weight);
}

void bt_map_results(const bt_map *map, const int32_t e_q4[BT_ELECTRODES],
                    const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                    int32_t pdc_above_rest_q4, int axes, int32_t result[], bt_map_parts *parts)
{
    features inputs;
    const bt_map_word *word = bt_map_words(map);
    int32_t total[BT_MAP_AXES_MAX];
    total[0] = total[1] = total[2] = total[3] = total[4] = total[5] = total[6] = 0; // spares a memset
    const moments compression =
        prepare(map, e_q4, counts, tare_q4, pdc_above_rest_q4, parts != NULL, &inputs);
    if (parts != NULL) {
        begin_parts(parts, &inputs, compression.weight);
    }
    for (int b = 0; b < map->block_count; b++) {
        const uint8_t *head = map->blocks + b * BT_MAP_BLOCK_BYTES;
        int words = bt_map_coefficients[head[0]] / 2; // per axis
        int32_t *part = words == BT_MAP_PAIR_COEFFICIENTS / 2 ? part_of(parts, head[0]) : NULL;
        add_to_part(part, total, -1);
        add_block(head, &inputs, word, 0, 3, total);
        add_to_part(part, total, 1);
        if (axes == BT_MAP_AXES_TORSION) {
            add_block(head, &inputs, word + 3 * words, 3, 4, total);
        } else if (axes == BT_MAP_AXES_TORQUE) {
            add_block(head, &inputs, word + 3 * words, 3, 3, total);
        }
        word += map->axes * words;
    }
    for (int a = 0; a < axes; a++) {
        result[a] = bt_clamp(total[a], -BT_MAP_RESULT_MAX, BT_MAP_RESULT_MAX);
    }
}

void bt_map_wrench(const bt_map *map, const uint16_t counts[BT_ELECTRODES],
                   const uint16_t tare_q4[BT_ELECTRODES], int32_t pdc_above_rest_q4, int32_t force_100un[3],
                   int32_t *torque_mnmm, int32_t *torsion_mnmm)
{
    int32_t e_q4[BT_ELECTRODES];
    bt_signals_q4(counts, tare_q4, e_q4);
    bt_map_wrench_of(map, e_q4, counts, tare_q4, pdc_above_rest_q4, force_100un, torque_mnmm, torsion_mnmm,
                     NULL);
}

void bt_map_wrench_of(const bt_map *map, const int32_t e_q4[BT_ELECTRODES],
                      const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                      int32_t pdc_above_rest_q4, int32_t force_100un[3], int32_t *torque_mnmm,
                      int32_t *torsion_mnmm, bt_map_parts *parts)
{
    int axes = torque_mnmm == NULL ? BT_MAP_AXES_FORCE : map->axes;
    int32_t result[BT_MAP_AXES_MAX];
    for (int a = 0; a < BT_MAP_AXES_MAX; a++) {
        result[a] = BT_INVALID_I32;
    }
    if (pdc_above_rest_q4 != BT_INVALID_I32 || !bt_map_needs_pdc(map)) {
        bt_map_results(map, e_q4, counts, tare_q4, pdc_above_rest_q4, axes, result, parts);
    }
    for (int d = 0; d < 3; d++) {
        force_100un[d] = result[d];
    }
    for (int d = 0; d < 3 && axes > BT_MAP_AXES_FORCE; d++) {
        torque_mnmm[d] = result[3 + d];
    }
    if (axes == BT_MAP_AXES_TORSION) {
        *torsion_mnmm = result[6];
    }
}
