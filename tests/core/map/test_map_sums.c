// A wrench map's arithmetic: worked by hand, and at the edges of its bounds.
#include "map_words.h"

#include <math.h>

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

#define T(name) cmocka_unit_test(name)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_sum_worked_by_hand),
        T(an_offset_and_pressure_stand_alone),
        T(conductance_is_right_at_every_count),
        T(gates_are_the_compressions_centroid),
        T(no_count_overflows_a_map_at_its_bounds),
        T(results_saturate_with_their_sign),
        T(torque_is_the_second_three_and_only_where_there_is_one),
        T(torsion_is_summed_as_the_others_are),
        T(torsions_coefficients_are_behind_the_triples),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
