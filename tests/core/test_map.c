// A wrench map's blob at the door, its arithmetic at the edges of its bounds, and what a mapped frame
// publishes.
#include "emulated_finger.h"
#include "map.h"
#include "results.h"
#include "support.h"

#define WORD(high, low) ((uint32_t)(uint16_t)(high) << 16 | (uint16_t)(low))

static const uint32_t columns_of[BT_MAP_KINDS] = BT_MAP_KIND_COLUMNS;
static const uint32_t axes_of[] = {3, 6, 7};

#define SOME_AXES (sizeof axes_of / sizeof *axes_of)

// Of a map of one block: words of the blob.
#define HEAD  (BT_MAP_HEADER_BYTES / 4)
#define FIRST (HEAD + BT_MAP_BLOCK_BYTES / 4) // coefficient

// A blob under construction, in words, so that it lies as a board keeps it.
typedef struct {
    uint32_t word[BT_MAP_MAX_BYTES / 4 + 2];
    uint32_t words;
    uint32_t axes;
} blob;

static uint8_t *bytes_of(blob *its)
{
    return (uint8_t *)its->word;
}

static void begin(blob *its, uint32_t axes, uint32_t blocks)
{
    memset(its, 0, sizeof *its);
    its->axes = axes;
    its->word[0] = BT_MAP_VERSION | axes << 8 | blocks << 16;
    its->words = BT_MAP_HEADER_BYTES / 4;
}

static void block(blob *its, uint32_t kind, uint32_t gate, uint32_t exponent)
{
    its->word[its->words++] = kind | gate << 8 | exponent << 16 | exponent << 24;
    its->word[its->words++] = its->axes > 3 ? 0x01010101u * exponent : exponent;
    its->word[its->words++] = its->axes == 7 ? exponent : 0;
}

static void fill(blob *its, uint32_t kind, uint32_t value)
{
    for (uint32_t k = 0; k < columns_of[kind] * its->axes; k++) {
        its->word[its->words++] = value;
    }
}

// A block of one kind whose coefficients all are one.
static void one_block(blob *its, uint32_t axes, uint32_t kind, uint32_t gate, uint32_t exponent,
                      uint32_t value)
{
    begin(its, axes, 1);
    block(its, kind, gate, exponent);
    fill(its, kind, value);
}

static uint8_t opened(blob *its, bt_map *map)
{
    return bt_map_open(map, bytes_of(its), 4 * its->words);
}

// ---- the door ------------------------------------------------------------------------------------------

static void a_blob_is_read_where_it_lies(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    one_block(&its, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_X, 2, WORD(1, -1));
    memcpy(bytes_of(&its) + 4, "BTEMU00000000042", 16);
    its.word[5] = 1763731310;
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    assert_true(map.axes == 3 && map.block_count == 1 && map.made_s == 1763731310);
    assert_ptr_equal(map.serial, bytes_of(&its) + 4);
    assert_ptr_equal(map.coefficients, bytes_of(&its) + 36);
    assert_false(bt_map_needs_pdc(&map));
}

static void assert_refused(blob *its, uint8_t error)
{
    bt_map map;
    memset(&map, 0xFF, sizeof map);
    assert_int_equal(opened(its, &map), error);
    assert_int_equal(map.axes, 0);
}

static void every_byte_of_the_head_is_judged(void **state)
{
    (void)state;
    static const struct {
        int at;
        uint8_t value, error;
    } wrong[] = {
        {0, BT_MAP_VERSION + 1, BT_ERROR_OUT_OF_RANGE},
        {1, 0, BT_ERROR_OUT_OF_RANGE},
        {1, 4, BT_ERROR_OUT_OF_RANGE},
        {1, 5, BT_ERROR_OUT_OF_RANGE},
        {1, 6, BT_ERROR_BAD_LENGTH}, // twice the coefficients
        {1, 7, BT_ERROR_BAD_LENGTH},
        {1, 8, BT_ERROR_OUT_OF_RANGE},
        {2, 0, BT_ERROR_BAD_LENGTH},
        {2, 2, BT_ERROR_OUT_OF_RANGE}, // coefficients for a block: no such kind
        {2, 255, BT_ERROR_BAD_LENGTH},
        {3, 1, BT_ERROR_OUT_OF_RANGE},
        {24, BT_MAP_KINDS, BT_ERROR_OUT_OF_RANGE},
        {24, 255, BT_ERROR_OUT_OF_RANGE},
        {24, BT_MAP_KIND_OFFSET, BT_ERROR_BAD_LENGTH},
        {25, BT_MAP_GATES, BT_ERROR_OUT_OF_RANGE},
        {26, BT_MAP_EXPONENT_MAX + 1, BT_ERROR_OUT_OF_RANGE},
        {28, 255, BT_ERROR_OUT_OF_RANGE},
        {29, 1, BT_ERROR_OUT_OF_RANGE}, // of an axis that is not there
        {32, 1, BT_ERROR_OUT_OF_RANGE},
        {35, 1, BT_ERROR_OUT_OF_RANGE}, // and of none that may be
    };
    static blob its;
    bt_map map;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        one_block(&its, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, BT_MAP_EXPONENT_MAX, WORD(100, 0x77));
        assert_int_equal(opened(&its, &map), BT_ERROR_OK);
        bytes_of(&its)[wrong[k].at] = wrong[k].value;
        assert_refused(&its, wrong[k].error);
    }
}

static void every_length_but_one_is_refused(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    for (size_t k = 0; k < SOME_AXES; k++) {
        one_block(&its, axes_of[k], BT_MAP_KIND_BULGE, BT_MAP_GATE_YY, 1, 5);
        assert_int_equal(4 * its.words, 24 + 12 + 4 * 19 * axes_of[k]);
        for (size_t bytes = 0; bytes <= sizeof its.word; bytes++) {
            uint8_t error = bt_map_open(&map, bytes_of(&its), bytes);
            assert_int_equal(error, bytes == 4 * its.words ? BT_ERROR_OK : BT_ERROR_BAD_LENGTH);
        }
    }
    memmove(bytes_of(&its) + 2, bytes_of(&its), 4 * its.words);
    assert_int_equal(bt_map_open(&map, bytes_of(&its) + 2, 4 * its.words), BT_ERROR_OUT_OF_RANGE);
}

static void a_block_comes_once(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    for (uint32_t second = 0; second < BT_MAP_GATES; second++) {
        begin(&its, 3, 2);
        block(&its, BT_MAP_KIND_OFFSET, BT_MAP_GATE_XY, 0);
        block(&its, BT_MAP_KIND_OFFSET, second, 0);
        fill(&its, BT_MAP_KIND_OFFSET, 9);
        fill(&its, BT_MAP_KIND_OFFSET, 9);
        assert_int_equal(opened(&its, &map), second == BT_MAP_GATE_XY ? BT_ERROR_OUT_OF_RANGE : BT_ERROR_OK);
    }
}

// Which coefficients stand in one sum: all of a block, or a row of pairs. 2^31 - 2^16 fits, one more does
// not.
static void coefficients_are_bounded_sum_by_sum(void **state)
{
    (void)state;
    static blob its;
    for (uint32_t kind = 0; kind < BT_MAP_KINDS; kind++) {
        uint32_t first = 0, row = BT_ELECTRODES;
        while (first < columns_of[kind]) {
            uint32_t last = columns_of[kind] == BT_MAP_PAIRS ? first + row - 1 : columns_of[kind] - 1;
            for (uint32_t axis = 0; axis < 7; axis++) {
                uint32_t width = axis < 6 ? 3 : 1; // of the group that the axis is in
                one_block(&its, 7, kind, BT_MAP_GATE_ONE, 0, 0);
                uint32_t *group = its.word + its.words - (7 - axis / 3 * 3) * columns_of[kind];
                bt_map map;
                // All but 1, or all but 2^16; the rest of the sum stands in its last word.
                group[width * first + axis % 3] = axis & 1 ? WORD(32766, 0) : WORD(-32767, 1);
                if (last > first) {
                    group[width * last + axis % 3] = axis & 1 ? WORD(-1, 0) : WORD(0, -1);
                    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
                    group[width * last + axis % 3] = axis & 1 ? WORD(-1, -1) : WORD(0, -2);
                } else {
                    group[width * first + axis % 3] = axis & 1 ? WORD(32767, 0) : WORD(-32767, 0);
                    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
                    group[width * first + axis % 3] = axis & 1 ? WORD(32767, 1) : WORD(-32767, -1);
                }
                assert_refused(&its, BT_ERROR_OUT_OF_RANGE);
                group[width * first + axis % 3] = WORD(-32768, -32768); // the largest there is
                assert_refused(&its, BT_ERROR_OUT_OF_RANGE);
            }
            first = last + 1;
            row--;
        }
    }
}

// ---- the arithmetic ------------------------------------------------------------------------------------

static void assert_force(const bt_map *map, const uint16_t *counts, const uint16_t *tare_q4, int32_t pdc_q4,
                         int32_t x, int32_t y, int32_t z)
{
    int32_t force[3];
    bt_map_wrench(map, counts, tare_q4, pdc_q4, force, NULL, NULL);
    assert_int_equal(force[0], x);
    assert_int_equal(force[1], y);
    assert_int_equal(force[2], z);
}

static void set(uint16_t values[BT_ELECTRODES], uint16_t value)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        values[i] = value;
    }
}

static void a_sum_worked_by_hand(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(counts, 3000);
    set(tare_q4, 48000);
    counts[4] = 2900; // e = -1600 / 16
    counts[5] = 3010; // e = 160 / 16
    one_block(&its, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 8, 0);
    uint32_t *words = its.word + FIRST;
    words[3 * 4] = WORD(256, 0);
    words[3 * 5 + 1] = WORD(-256, 0);
    words[3 * 4 + 2] = WORD(0, 32767); // -1600 * 32767 / 65536 = -799.98, cut to -800
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    // (9 - 1600 * 256) 2^8 / 2^16 = -1599.96; (9 - 160 * 256) / 2^8 = -159.96; (9 - 800) / 2^8 = -3.09
    assert_force(&map, counts, tare_q4, 0, -1600, -160, -3);
    counts[4] = BT_INVALID_COUNT; // no signal; 9 / 2^8
    assert_force(&map, counts, tare_q4, 0, 0, -160, 0);
    tare_q4[5] = BT_INVALID_COUNT;
    assert_force(&map, counts, tare_q4, 0, 0, 0, 0);
    set(counts, 2999);
    set(tare_q4, 48000);
    one_block(&its, 3, BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_GATE_ONE, 16, WORD(1024, 0));
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    // 190 e_i e_j c = 190 * 16^2 * 1024 / 2^16 = 760; rows of n have n >> 1 too much, so that 18 of 19
    // products are a hair below 4 n and cut by one; 9 to begin with
    assert_force(&map, counts, tare_q4, 0, 751, 751, 751);
}

static void an_offset_and_pressure_stand_alone(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(counts, BT_INVALID_COUNT);
    set(tare_q4, BT_INVALID_COUNT);
    begin(&its, 3, 2);
    block(&its, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 16);
    block(&its, BT_MAP_KIND_PRESSURE, BT_MAP_GATE_ONE, 16);
    its.word[its.words++] = WORD(3, 0); // 2^15 times it
    its.word[its.words++] = WORD(-3, 0);
    its.word[its.words++] = WORD(0, 5);
    fill(&its, BT_MAP_KIND_PRESSURE, WORD(1, 0));
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    assert_true(bt_map_needs_pdc(&map));
    assert_force(&map, counts, tare_q4, 0, 3 << 15, -(3 << 15), 2);
    assert_force(&map, counts, tare_q4, -1000, (3 << 15) - 1000, -(3 << 15) - 1000, 2 - 1000);
    assert_force(&map, counts, tare_q4, INT32_MAX, (3 << 15) + 65520, -(3 << 15) + 65520, 2 + 65520);
    assert_force(&map, counts, tare_q4, BT_INVALID_I32, BT_INVALID_I32, BT_INVALID_I32, BT_INVALID_I32);
}

// u = G(c)/G(t) - 1 of every count at some tares, against the real number: at most 1.15 units of 2^-24 too
// small.
static void conductance_is_right_at_every_count(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    static const uint16_t tares[] = {0, 1, 15, 16, 17, 800, 33333, 48000, 56007, 65440, 65441, 65520};
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    const double scale = 1024.0 / 65536; // of a sum to the result
    one_block(&its, 3, BT_MAP_KIND_CONDUCTANCE, BT_MAP_GATE_ONE, 10, 0);
    its.word[FIRST] = WORD(32767, 0);
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    set(counts, 3000);
    set(tare_q4, 48000);
    for (size_t t = 0; t < sizeof tares / sizeof *tares; t++) {
        for (int c = 0; c <= BT_FULL_SCALE_COUNT; c++) {
            int32_t force[3];
            double at = c < 1 ? 1 : c > 4090 ? 4090 : c;
            double rest = tares[t] < 16 ? 1 : tares[t] > 65440 ? 4090 : tares[t] / 16.0;
            double u = at / (4095 - at) * (4095 - rest) / rest - 1;
            double wanted = (u > 3 ? 3 : u) * 16384 * 32767;
            counts[0] = (uint16_t)c;
            tare_q4[0] = tares[t];
            bt_map_wrench(&map, counts, tare_q4, 0, force, NULL, NULL);
            // A unit of u is 2^-10 of a factor, here 32 of the sum; that begins with 9 and is cut once.
            assert_true(fabs(force[0] - wanted * scale) < 0.5 + (1.15 * 32 + 10) * scale);
        }
    }
}

// A block of 2^19 times its gate is the gate, in 2^-19; against the real centroid.
static void gates_are_the_compressions_centroid(void **state)
{
    (void)state;
    static blob its;
    static const double off[BT_MAP_GATES] = {0, 0.6, 0.6, 2.6, 2.6, 2.6}; // SPEC.md
    uint64_t seed = 12;
    double reached[BT_MAP_GATES] = {0};
    for (int frame = 0; frame < 20000; frame++) {
        uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
        double weight = 0, x = 0, y = 0;
        int alone = frame < 2 * BT_ELECTRODES ? frame / 2 : -1;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            int64_t size = frame % 4 == 0 ? 65520 : 4000;
            int64_t e_q4 = alone >= 0 ? (i == alone ? -65520 : 0) : random_range(&seed, -size, size / 4);
            tare_q4[i] = (uint16_t)(e_q4 < 0 ? -e_q4 : 0);
            counts[i] = (uint16_t)(e_q4 < 0 ? 0 : e_q4 / 16);
            double w = (e_q4 < 0 ? (double)-e_q4 : 0) / 16 + 5;
            weight += w;
            x += w * bt_electrode_um[i][0] / 8000;
            y += w * bt_electrode_um[i][1] / 4000;
        }
        x /= weight;
        y /= weight;
        const double wanted[BT_MAP_GATES] = {1, x, y, x * x, x * y, y * y};
        for (uint32_t gate = 0; gate < BT_MAP_GATES; gate++) {
            bt_map map;
            int32_t force[3];
            one_block(&its, 3, BT_MAP_KIND_OFFSET, gate, 16, WORD(16, 0));
            assert_int_equal(opened(&its, &map), BT_ERROR_OK);
            bt_map_wrench(&map, counts, tare_q4, 0, force, NULL, NULL);
            double error = fabs(force[0] - wanted[gate] * (1 << BT_MAP_GATE_Q));
            assert_true(error <= off[gate]);
            assert_true(abs(force[0]) <= BT_MAP_GATE_MAX);
            reached[gate] = error > reached[gate] ? error : reached[gate];
        }
    }
    for (int gate = 1; gate < BT_MAP_GATES; gate++) {
        assert_true(reached[gate] > 0.25 * off[gate]); // the bound is about something
    }
}

// All bits of every sum in use: a map at its bounds, all counts at one end or the other. Sanitizers watch.
static void no_count_overflows_a_map_at_its_bounds(void **state)
{
    (void)state;
    static blob its;
    uint64_t seed = 5;
    static const uint16_t ends[] = {0, 1, 4090, 4095, BT_INVALID_COUNT};
    for (int round = 0; round < 60; round++) {
        uint32_t axes = round < 20 ? 3 : 7;
        begin(&its, axes, 0);
        uint32_t blocks = 0;
        uint32_t kinds[BT_MAP_KINDS * BT_MAP_GATES];
        size_t bytes = BT_MAP_HEADER_BYTES;
        for (uint32_t k = 0; k < BT_MAP_KINDS * BT_MAP_GATES; k++) {
            uint32_t kind = (k + (uint32_t)round) % BT_MAP_KINDS;
            if (bytes + BT_MAP_BLOCK_BYTES + 4 * axes * columns_of[kind] > BT_MAP_MAX_BYTES) {
                continue;
            }
            bytes += BT_MAP_BLOCK_BYTES + 4 * axes * columns_of[kind];
            kinds[blocks++] = kind;
            block(&its, kind, (k / BT_MAP_KINDS + (uint32_t)round) % BT_MAP_GATES, BT_MAP_EXPONENT_MAX);
        }
        its.word[0] |= blocks << 16;
        for (uint32_t b = 0; b < blocks; b++) {
            uint32_t in_a_sum = columns_of[kinds[b]] == 1 ? 1 : BT_ELECTRODES;
            int32_t most = (int32_t)(BT_MAP_COEFFICIENT_SUM_MAX / in_a_sum);
            for (uint32_t k = 0; k < axes * columns_of[kinds[b]]; k++) {
                int32_t value = (round < 4 ? round & 1 : (int)random_range(&seed, 0, 1)) ? most : -most;
                int32_t low = (int16_t)(uint16_t)value;
                its.word[its.words++] = WORD((value - low) / 65536, low);
            }
        }
        bt_map map;
        assert_int_equal(opened(&its, &map), BT_ERROR_OK);
        for (int frame = 0; frame < 40; frame++) {
            uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
            int32_t wrench[7] = {0}, again[7] = {0};
            for (int i = 0; i < BT_ELECTRODES; i++) {
                counts[i] = ends[frame < 5 ? frame : random_range(&seed, 0, 4)];
                tare_q4[i] = frame < 10 ? (frame & 1 ? 0 : 65520) : (uint16_t)random_range(&seed, 0, 65520);
            }
            int32_t pdc_q4 = frame & 2 ? 65520 : -65520;
            bt_map_wrench(&map, counts, tare_q4, pdc_q4, wrench, wrench + 3, wrench + 6);
            bt_map_wrench(&map, counts, tare_q4, pdc_q4, again, again + 3, again + 6);
            assert_memory_equal(wrench, again, sizeof wrench);
            for (uint32_t a = 0; a < axes; a++) {
                assert_true(wrench[a] >= -BT_MAP_RESULT_MAX && wrench[a] <= BT_MAP_RESULT_MAX);
            }
        }
    }
}

static void results_saturate_with_their_sign(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(counts, 4095);
    set(tare_q4, 0);
    one_block(&its, 7, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 16, WORD(-32000, 0));
    its.word[FIRST] = WORD(32000, 0);
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    assert_force(&map, counts, tare_q4, 0, BT_MAP_RESULT_MAX, -BT_MAP_RESULT_MAX, -BT_MAP_RESULT_MAX);
    int32_t force[3], torque[3], torsion;
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_true(torque[2] == -BT_MAP_RESULT_MAX && torsion == -BT_MAP_RESULT_MAX);
    its.word[FIRST + 6] = WORD(32000, 0);
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_true(torque[2] == -BT_MAP_RESULT_MAX && torsion == BT_MAP_RESULT_MAX);
}

static void torque_is_the_second_three_and_only_where_there_is_one(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    int32_t force[3], torque[3] = {7, 7, 7}, torsion = 7;
    set(counts, 3000);
    set(tare_q4, 48000);
    begin(&its, 6, 2);
    block(&its, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 16);
    block(&its, BT_MAP_KIND_OFFSET, BT_MAP_GATE_Y, 16);
    for (int k = 1; k <= 6; k++) {
        its.word[its.words++] = WORD(2 * k, 0);
    }
    fill(&its, BT_MAP_KIND_OFFSET, 0);
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_int_equal(torsion, 7);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(force[d], (d + 1) << 16);
        assert_int_equal(torque[d], (d + 4) << 16);
    }
    bt_map_wrench(&map, counts, tare_q4, 0, force, NULL, NULL);
    assert_int_equal(force[2], 3 << 16);
    one_block(&its, 3, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 16, WORD(2, 0));
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    memset(torque, 0, sizeof torque);
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_true(force[1] == 1 << 16 && torque[1] == 0 && torsion == 7);
}

// The same columns in all seven axes give one and the same number seven times, whatever the kind: torsion's
// rows are summed apart from the others'.
static void torsion_is_summed_as_the_others_are(void **state)
{
    (void)state;
    static blob its;
    uint64_t seed = 21;
    for (uint32_t k = 0; k < BT_MAP_KINDS * BT_MAP_GATES; k++) {
        uint32_t kind = k / BT_MAP_GATES;
        bt_map map;
        begin(&its, 7, 1);
        block(&its, kind, k % BT_MAP_GATES, 6);
        uint32_t *words = its.word + its.words;
        fill(&its, kind, 0);
        for (uint32_t c = 0; c < columns_of[kind]; c++) {
            uint32_t value = WORD(random_range(&seed, -1500, 1500), random_range(&seed, -32768, 32767));
            for (uint32_t axis = 0; axis < 3; axis++) {
                words[3 * c + axis] = words[3 * (columns_of[kind] + c) + axis] = value;
            }
            words[6 * columns_of[kind] + c] = value;
        }
        assert_int_equal(opened(&its, &map), BT_ERROR_OK);
        int moved = 0;
        for (int frame = 0; frame < 200; frame++) {
            uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
            int32_t force[3], torque[3], torsion = 0;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                counts[i] = (uint16_t)random_range(&seed, 0, 4095);
                tare_q4[i] = (uint16_t)random_range(&seed, 0, 65520);
            }
            int32_t pdc_q4 = (int32_t)random_range(&seed, -65520, 65520);
            bt_map_wrench(&map, counts, tare_q4, pdc_q4, force, torque, &torsion);
            for (int d = 0; d < 3; d++) {
                assert_true(force[d] == torsion && torque[d] == torsion);
            }
            moved += torsion != 0;
        }
        assert_true(moved > 100);
    }
}

// Each of its 19 coefficients stands where SPEC.md has it: behind the six others' of its block.
static void torsions_coefficients_are_behind_the_triples(void **state)
{
    (void)state;
    static blob its;
    for (uint32_t column = 0; column < BT_ELECTRODES; column++) {
        bt_map map;
        uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
        int32_t force[3], torque[3], torsion;
        begin(&its, 7, 2);
        block(&its, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 0);
        block(&its, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 0);
        bytes_of(&its)[24 + 2 + 6] = 16;    // exponent of torsion alone
        its.words += 7 * BT_ELECTRODES + 7; // all 0
        its.word[HEAD + 2 * (FIRST - HEAD) + 6 * BT_ELECTRODES + column] = WORD(4, 0);
        assert_int_equal(opened(&its, &map), BT_ERROR_OK);
        set(counts, 3000);
        set(tare_q4, 48000);
        counts[column] = 3100; // e = 1600 / 16; (9 + 1600 * 4) 2^16 / 2^16
        bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
        assert_int_equal(torsion, 9 + 1600 * 4);
        assert_true(force[0] == 0 && force[2] == 0 && torque[0] == 0 && torque[2] == 0);
    }
}

// ---- what is published ---------------------------------------------------------------------------------

static bt_msg_frame published(emulated_finger *finger, const bt_map *map, uint16_t pdc, uint32_t quantities)
{
    bt_settings all;
    bt_settings_reset(&all);
    bt_kernel_settings settings = bt_kernel_settings_from(&all);
    assert_true(settings.map == NULL);
    settings.map = map;
    bt_frame frame = next_frame(finger);
    frame.pdc = pdc;
    finger->tare.noise.count2 = 400;
    bt_msg_frame msg;
    memset(&msg, 0, sizeof msg);
    bt_results(&frame, &finger->tare, &settings, quantities, &msg);
    memcpy(msg.counts, frame.electrode, sizeof msg.counts);
    return msg;
}

static emulated_finger pressed(void)
{
    emulated_finger finger;
    finger_init(&finger);
    finger.sigma = 0;
    finger.has_pdc = true;
    run_seconds(&finger, 5);
    finger.load = 400;
    finger.pdc_load = 50;
    (void)run_until(&finger, BT_TARE_STATE_CONTACT, 10);
    return finger;
}

static void mixed_map(blob *its, bt_map *map, uint32_t axes)
{
    begin(its, axes, 2);
    block(its, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 6);
    block(its, BT_MAP_KIND_PRESSURE, BT_MAP_GATE_X, 4);
    for (uint32_t k = 0; k < columns_of[BT_MAP_KIND_SIGNAL] * axes; k++) {
        its->word[its->words++] = WORD(40 + 13 * (k % 7) - (k % axes == 1 ? 400 : 0), 77 * k);
    }
    for (uint32_t k = 0; k < axes; k++) {
        its->word[its->words++] = WORD(100 + k, 3);
    }
    assert_int_equal(opened(its, map), BT_ERROR_OK);
}

static void a_mapped_frame_has_the_maps_force_and_says_so(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    emulated_finger finger = pressed();
    uint32_t rest_q4 = (finger.tare.base.pdc_q16 + (1 << 11)) >> 12;
    for (size_t k = 0; k < SOME_AXES; k++) {
        uint32_t axes = axes_of[k];
        mixed_map(&its, &map, axes);
        bt_msg_frame plain = published(&finger, NULL, 1400, BT_WANT_ALL | BT_QUANTITY_FLAG_SIGMA);
        bt_msg_frame msg = published(&finger, &map, 1400, BT_WANT_ALL | BT_QUANTITY_FLAG_SIGMA);
        assert_memory_equal(plain.counts, msg.counts, sizeof msg.counts);
        assert_int_equal(msg.flags, plain.flags | BT_FRAME_FLAG_MAPPED);
        assert_memory_equal(msg.poc_um, plain.poc_um, sizeof msg.poc_um);
        assert_true(msg.poc_sigma_um == plain.poc_sigma_um && msg.poc_sigma_um != 0xFFFF);
        int32_t force[3], torque[3], torsion = BT_INVALID_I32;
        bt_map_wrench(&map, msg.counts, finger.tare.electrode_q4, 16 * 1400 - (int32_t)rest_q4, force, torque,
                      &torsion);
        assert_int_equal(plain.torsion_mnmm, BT_INVALID_I32);
        assert_int_equal(msg.torsion_mnmm, torsion);
        assert_true((torsion != BT_INVALID_I32) == (axes == 7));
        assert_memory_equal(msg.force_100un, force, sizeof force);
        for (int d = 0; d < 3; d++) {
            assert_int_not_equal(force[d], plain.force_100un[d]);
            assert_int_equal(msg.force_sigma_100un[d], 0xFFFF);
            assert_int_not_equal(plain.force_sigma_100un[d], 0xFFFF);
        }
        if (axes > 3) {
            assert_memory_equal(msg.torque_mnmm, torque, sizeof torque);
            continue;
        }
        assert_memory_equal(msg.torque_mnmm + 1, plain.torque_mnmm + 1, 2 * sizeof *torque);
        // x is the published point times the published force, within what rounding the point to um leaves.
        double y_mn = force[1] / 10.0, z_mn = force[2] / 10.0;
        double x = (msg.poc_um[1] * z_mn - msg.poc_um[2] * y_mn) / 1000;
        assert_true(fabs(msg.torque_mnmm[0] - x) < 0.6 + 0.0006 * (fabs(y_mn) + fabs(z_mn)));
        assert_int_not_equal(msg.torque_mnmm[0], plain.torque_mnmm[0]);
    }
}

static void without_pressure_a_map_that_needs_it_gives_nothing(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    emulated_finger finger = pressed();
    for (size_t k = 0; k < SOME_AXES; k++) {
        uint32_t axes = axes_of[k];
        mixed_map(&its, &map, axes);
        bt_msg_frame plain = published(&finger, NULL, BT_INVALID_COUNT, BT_WANT_ALL);
        bt_msg_frame msg = published(&finger, &map, BT_INVALID_COUNT, BT_WANT_ALL);
        assert_int_equal(msg.flags, plain.flags | BT_FRAME_FLAG_MAPPED);
        assert_int_equal(msg.torsion_mnmm, BT_INVALID_I32);
        assert_true(msg.flags & BT_FRAME_FLAG_PDC_MISSING);
        for (int d = 0; d < 3; d++) {
            assert_int_equal(msg.force_100un[d], BT_INVALID_I32);
            bool by_gains = axes == 3 && d > 0;
            assert_int_equal(msg.torque_mnmm[d], by_gains ? plain.torque_mnmm[d] : BT_INVALID_I32);
        }
        uint32_t known = finger.tare.base.pdc_q16;
        finger.tare.base.pdc_q16 = BT_TARE_UNKNOWN; // a pressure, but nothing to compare it with
        msg = published(&finger, &map, 1400, BT_WANT_ALL);
        assert_int_equal(msg.force_100un[0], BT_INVALID_I32);
        finger.tare.base.pdc_q16 = known;
    }
    one_block(&its, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 6, WORD(30, 0)); // needs none
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    assert_int_not_equal(published(&finger, &map, BT_INVALID_COUNT, BT_WANT_ALL).force_100un[0],
                         BT_INVALID_I32);
}

static void what_is_not_asked_for_changes_nothing_that_is(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    emulated_finger finger = pressed();
    for (size_t k = 0; k < SOME_AXES; k++) {
        uint32_t axes = axes_of[k];
        mixed_map(&its, &map, axes);
        bt_msg_frame all = published(&finger, &map, 1400, BT_WANT_ALL);
        for (uint32_t wanted = 0; wanted <= BT_WANT_ALL; wanted++) {
            bt_msg_frame msg = published(&finger, &map, 1400, wanted);
            bool force = wanted & BT_WANT_FORCE, torque = wanted & BT_WANT_TORQUE, poc = wanted & BT_WANT_POC;
            assert_int_equal(msg.torsion_mnmm, torque ? all.torsion_mnmm : BT_INVALID_I32);
            for (int d = 0; d < 3; d++) {
                assert_int_equal(msg.force_100un[d], force ? all.force_100un[d] : BT_INVALID_I32);
                assert_int_equal(msg.torque_mnmm[d], torque ? all.torque_mnmm[d] : BT_INVALID_I32);
                assert_int_equal(msg.poc_um[d], poc ? all.poc_um[d] : BT_INVALID_I16);
            }
        }
    }
    finger.tare.reason = BT_TARE_REASON_NONE;
    bt_msg_frame msg = published(&finger, &map, 1400, BT_WANT_ALL);
    assert_true(msg.flags & BT_FRAME_FLAG_UNTARED && !(msg.flags & BT_FRAME_FLAG_MAPPED));
    assert_int_equal(msg.force_100un[2], BT_INVALID_I32);
    assert_int_equal(msg.torsion_mnmm, BT_INVALID_I32);
}

#define T(name) cmocka_unit_test(name)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_blob_is_read_where_it_lies),
        T(every_byte_of_the_head_is_judged),
        T(every_length_but_one_is_refused),
        T(a_block_comes_once),
        T(coefficients_are_bounded_sum_by_sum),
        T(a_sum_worked_by_hand),
        T(an_offset_and_pressure_stand_alone),
        T(conductance_is_right_at_every_count),
        T(gates_are_the_compressions_centroid),
        T(no_count_overflows_a_map_at_its_bounds),
        T(results_saturate_with_their_sign),
        T(torque_is_the_second_three_and_only_where_there_is_one),
        T(torsion_is_summed_as_the_others_are),
        T(torsions_coefficients_are_behind_the_triples),
        T(a_mapped_frame_has_the_maps_force_and_says_so),
        T(without_pressure_a_map_that_needs_it_gives_nothing),
        T(what_is_not_asked_for_changes_nothing_that_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
