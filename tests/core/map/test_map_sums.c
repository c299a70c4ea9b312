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

TEST(a_sum_worked_by_hand)
{
    static blob stored;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(counts, 3000);
    set(tare_q4, 48000);
    counts[4] = 2900; // e = -1600 / 16
    counts[5] = 3010; // e = 160 / 16
    one_block(&stored, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 8, 0);
    *half(&stored, FIRST, BT_MAP_KIND_SIGNAL, 4, 0) = 256;
    *half(&stored, FIRST, BT_MAP_KIND_SIGNAL, 5, 1) = -256;
    *half(&stored, FIRST, BT_MAP_KIND_SIGNAL, 4, 2) = 1;
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    // -400 * 256 / 2^8; -40 * 256 / 2^8; -400 / 2^8 = -1.56
    assert_force(&map, counts, tare_q4, 0, -400, -40, -2);
    counts[4] = BT_INVALID_COUNT; // no signal
    assert_force(&map, counts, tare_q4, 0, 0, -40, 0);
    tare_q4[5] = BT_INVALID_COUNT;
    assert_force(&map, counts, tare_q4, 0, 0, 0, 0);
    set(counts, 2999);
    set(tare_q4, 48000);
    one_block(&stored, 3, BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_GATE_ONE, 1, 2048);
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    // each row -4 * 10 * 2048, times -4 over 2^16 is 5; 19 of them, over 2
    assert_force(&map, counts, tare_q4, 0, 48, 48, 48);
    counts[7] = 3010; // 40: ten rows have it, of (40 - 9 * 4) 2048 each
    // its own times 40 over 2^16 is 5, nine times -4 are -0.5, which is -1, nine others 5 as before; over 2
    assert_force(&map, counts, tare_q4, 0, 21, 21, 21);
}

// Each pair once: of two electrodes that move, what stands beside their product is what comes out.
TEST(every_pair_has_a_place_in_the_ring)
{
    static blob stored;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(tare_q4, 48000);
    for (int first = 0; first < BT_ELECTRODES; first++) {
        for (int behind = 0; behind < 10; behind++) {
            set(counts, 3000);
            counts[first] = 2900;
            counts[(first + behind) % BT_ELECTRODES] = 2900;
            one_block(&stored, 3, BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_GATE_ONE, 1, 0);
            *half(&stored, FIRST, BT_MAP_KIND_SIGNAL_PAIRS, (uint32_t)(10 * first + behind), 1) = 32767;
            assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
            // 400 * 400 * 32767 / 2^16 = 79997.6, over 2
            assert_force(&map, counts, tare_q4, 0, 0, 39999, 0);
        }
    }
}

TEST(an_offset_and_pressure_stand_alone)
{
    static blob stored;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(counts, BT_INVALID_COUNT);
    set(tare_q4, BT_INVALID_COUNT);
    begin(&stored, 3, 2);
    block(&stored, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 3);
    block(&stored, BT_MAP_KIND_PRESSURE, BT_MAP_GATE_ONE, 3);
    uint32_t first = fill(&stored, BT_MAP_KIND_OFFSET, 0);
    *half(&stored, first, BT_MAP_KIND_OFFSET, 0, 0) = 3; // 2^13 times it, over 2^3
    *half(&stored, first, BT_MAP_KIND_OFFSET, 0, 1) = -3;
    *half(&stored, first, BT_MAP_KIND_OFFSET, 0, 2) = 5;
    (void)fill(&stored, BT_MAP_KIND_PRESSURE, 8);
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    assert_true(bt_map_needs_pdc(&map));
    assert_force(&map, counts, tare_q4, 0, 3 << 10, -(3 << 10), 5 << 10);
    assert_force(&map, counts, tare_q4, -1000, (3 << 10) - 500, -(3 << 10) - 500, (5 << 10) - 500);
    assert_force(&map, counts, tare_q4, INT32_MAX, (3 << 10) + 32760, -(3 << 10) + 32760, (5 << 10) + 32760);
    assert_force(&map, counts, tare_q4, BT_INVALID_I32, BT_INVALID_I32, BT_INVALID_I32, BT_INVALID_I32);
}

// u = G(c)/G(t) - 1 of every count at some tares, against the real number: within half a unit of 2^-13 and
// 0.52 units times u. Every divisor's reciprocal is among them.
TEST(conductance_is_right_at_every_count)
{
    static blob stored;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    double worst = 0;
    one_block(&stored, 3, BT_MAP_KIND_CONDUCTANCE, BT_MAP_GATE_ONE, 13, 0);
    *half(&stored, FIRST, BT_MAP_KIND_CONDUCTANCE, 0, 0) = 8192;
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    set(counts, 3000);
    set(tare_q4, 48000);
    for (uint32_t t = 0; t <= 65520; t += t < 20 || (t > 1020 && t < 1030) || t > 65435 ? 1 : 673) {
        for (int c = 0; c <= BT_FULL_SCALE_COUNT; c++) {
            int32_t force[3];
            double at = c < 1 ? 1 : c > 4090 ? 4090 : c;
            double rest = t < 16 ? 1 : t > 65440 ? 4090 : t / 16.0;
            double u = at / (4095 - at) * (4095 - rest) / rest - 1;
            u = u > 3 ? 3 : u;
            counts[0] = (uint16_t)c;
            tare_q4[0] = (uint16_t)t;
            bt_map_wrench(&map, counts, tare_q4, 0, force, NULL, NULL);
            double off = fabs(force[0] - 8192 * u) / (0.5 + 0.52 * fabs(u));
            worst = off > worst ? off : worst;
        }
    }
    assert_true(worst <= 1 && worst > 0.9);
}

// A block of 2^27 times its gate, cut by 2^15 and over 2^12, is the gate in 2^-13; against the real centroid.
TEST(gates_are_the_compressions_centroid)
{
    static blob stored;
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
        // SPEC.md: weights off by half a quarter of a count, places by half of 2^-12, the quotient by half a
        // unit
        double spread_x = 0, spread_y = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            spread_x += fabs(bt_electrode_um[i][0] / 8000.0 - x);
            spread_y += fabs(bt_electrode_um[i][1] / 4000.0 - y);
        }
        double off_x = 1.5 + 4096 * spread_x / (4 * weight - 9.5),
               off_y = 1.5 + 4096 * spread_y / (4 * weight - 9.5);
        const double off[BT_MAP_GATES] = {0,
                                          off_x,
                                          off_y,
                                          2 * fabs(x) * off_x + off_x * off_x / 8192 + 0.5,
                                          fabs(x) * off_y + fabs(y) * off_x + off_x * off_y / 8192 + 0.5,
                                          2 * fabs(y) * off_y + off_y * off_y / 8192 + 0.5};
        const double wanted[BT_MAP_GATES] = {1, x, y, x * x, x * y, y * y};
        for (uint32_t gate = 1; gate < BT_MAP_GATES; gate++) {
            bt_map map;
            int32_t force[3];
            one_block(&stored, 3, BT_MAP_KIND_OFFSET, gate, 12, 1 << 14);
            assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
            bt_map_wrench(&map, counts, tare_q4, 0, force, NULL, NULL);
            double error = fabs(force[0] - wanted[gate] * (1 << BT_MAP_GATE_Q));
            assert_true(error <= off[gate]);
            assert_true(abs(force[0]) <= BT_MAP_GATE_MAX);
            reached[gate] = fmax(reached[gate], error / off[gate]);
        }
    }
    for (int gate = 1; gate < BT_MAP_GATES; gate++) {
        assert_true(reached[gate] > 0.25); // the bound is about something
    }
}

// All bits of every sum in use: a map at its bounds, all counts at one end or the other. Sanitizers watch.
TEST(no_count_overflows_a_map_at_its_bounds)
{
    static blob stored;
    uint64_t seed = 5;
    static const uint16_t ends[] = {0, 1, 4090, 4095, BT_INVALID_COUNT};
    // of a column, with which a block's or its rows' sums are just small enough
    static const int32_t most[BT_MAP_KINDS] = {32767, 6900, 6900, 6900, 2760, 4598, 1226, 32767};
    for (int round = 0; round < 60; round++) {
        uint32_t axes = round < 20 ? 3 : 7;
        begin(&stored, axes, 0);
        uint32_t blocks = 0;
        uint32_t kinds[BT_MAP_KINDS * BT_MAP_GATES];
        size_t bytes = BT_MAP_HEADER_BYTES;
        for (uint32_t k = 0; k < BT_MAP_KINDS * BT_MAP_GATES; k++) {
            uint32_t kind = (k + (uint32_t)round) % BT_MAP_KINDS;
            if (bytes + BT_MAP_BLOCK_BYTES + 2 * axes * coefficients_of[kind] > BT_MAP_MAX_BYTES) {
                continue;
            }
            bytes += BT_MAP_BLOCK_BYTES + 2 * axes * coefficients_of[kind];
            kinds[blocks++] = kind;
            block(&stored, kind, (k / BT_MAP_KINDS + (uint32_t)round) % BT_MAP_GATES, 6);
        }
        stored.word[0] |= blocks << 16;
        for (uint32_t b = 0; b < blocks; b++) {
            uint32_t first = fill(&stored, kinds[b], 0);
            for (uint32_t k = 0; k < axes * columns_of[kinds[b]]; k++) {
                bool up = round < 4 ? round & 1 : (int)random_range(&seed, 0, 1);
                *half(&stored, first, kinds[b], k / axes, k % axes) =
                    (int16_t)(up ? most[kinds[b]] : -most[kinds[b]]);
            }
        }
        bt_map map;
        assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
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

TEST(results_saturate_with_their_sign)
{
    static blob stored;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    set(counts, 4095);
    set(tare_q4, 0);
    one_block(&stored, 7, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 1, -32000);
    *half(&stored, FIRST, BT_MAP_KIND_OFFSET, 0, 0) = 32000;
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    assert_force(&map, counts, tare_q4, 0, BT_MAP_RESULT_MAX, -BT_MAP_RESULT_MAX, -BT_MAP_RESULT_MAX);
    int32_t force[3], torque[3], torsion;
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_true(torque[2] == -BT_MAP_RESULT_MAX && torsion == -BT_MAP_RESULT_MAX);
    *half(&stored, FIRST, BT_MAP_KIND_OFFSET, 0, 6) = 32000;
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_true(torque[2] == -BT_MAP_RESULT_MAX && torsion == BT_MAP_RESULT_MAX);
}

TEST(torque_is_the_second_three_and_only_where_there_is_one)
{
    static blob stored;
    bt_map map;
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    int32_t force[3], torque[3] = {7, 7, 7}, torsion = 7;
    set(counts, 3000);
    set(tare_q4, 48000);
    begin(&stored, 6, 2);
    block(&stored, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 1);
    block(&stored, BT_MAP_KIND_OFFSET, BT_MAP_GATE_Y, 16);
    uint32_t first = fill(&stored, BT_MAP_KIND_OFFSET, 0);
    for (uint32_t k = 0; k < 6; k++) {
        *half(&stored, first, BT_MAP_KIND_OFFSET, 0, k) = (int16_t)(k + 1);
    }
    (void)fill(&stored, BT_MAP_KIND_OFFSET, 0);
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_int_equal(torsion, 7);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(force[d], (d + 1) << 12);
        assert_int_equal(torque[d], (d + 4) << 12);
    }
    bt_map_wrench(&map, counts, tare_q4, 0, force, NULL, NULL);
    assert_int_equal(force[2], 3 << 12);
    one_block(&stored, 3, BT_MAP_KIND_OFFSET, BT_MAP_GATE_ONE, 1, 1);
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    memset(torque, 0, sizeof torque);
    bt_map_wrench(&map, counts, tare_q4, 0, force, torque, &torsion);
    assert_true(force[1] == 1 << 12 && torque[1] == 0 && torsion == 7);
}

// The same columns in all seven axes give one and the same number seven times, whatever the kind: torsion's
// rows are summed apart from the others'.
TEST(torsion_is_summed_as_the_others_are)
{
    static blob stored;
    uint64_t seed = 21;
    for (uint32_t k = 0; k < BT_MAP_KINDS * BT_MAP_GATES; k++) {
        uint32_t kind = k / BT_MAP_GATES;
        bt_map map;
        begin(&stored, 7, 1);
        block(&stored, kind, k % BT_MAP_GATES, 6);
        uint32_t first = fill(&stored, kind, 0);
        for (uint32_t c = 0; c < columns_of[kind]; c++) {
            int16_t value = (int16_t)random_range(&seed, -1000, 1000);
            for (uint32_t axis = 0; axis < 7; axis++) {
                *half(&stored, first, kind, c, axis) = value;
            }
        }
        assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
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

int main(void)
{
    return run_all(NULL, NULL);
}
