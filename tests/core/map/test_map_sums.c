// A wrench map's arithmetic: conductances against real numbers, and sums at the edges of their bounds.
#include "map_words.h"

#include <math.h>

static void set(uint16_t values[BT_ELECTRODES], uint16_t value)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        values[i] = value;
    }
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

// All bits of every sum in use: a map at the bounds, all counts at one end or the other. Sanitizers watch.
TEST(no_count_overflows_a_map_at_its_bounds)
{
    static blob stored;
    uint64_t seed = 5;
    static const uint16_t ends[] = {0, 1, 4090, 4095, BT_INVALID_COUNT};
    // largest of a column that keeps a block's and the rows' sums small enough
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
