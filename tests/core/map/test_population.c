// The population map: a board would take it, and nothing overflows; the force it gives for frames:
// tests/host/map/test_population_force.py.
#include "map/estimate.h"
#include "map/population.h"
#include "map/population_gen.h"
#include "support.h"

// The firmware's own map would be taken from a host too, which proves the bounds of the sums.
TEST(the_map_is_as_it_is_opened)
{
    bt_map map;
    const bt_map *population = &bt_population;
    assert_int_equal(bt_map_open(&map, population->serial - 4, BT_POPULATION_BYTES), BT_ERROR_OK);
    assert_true(map.axes == population->axes && map.block_count == population->block_count
                && map.kinds == population->kinds && map.gates == population->gates
                && map.serial == population->serial && map.blocks == population->blocks
                && map.coefficients == population->coefficients);
    assert_memory_equal(&map.margin, &population->margin, sizeof map.margin);
    assert_false(bt_map_needs_pdc(population));
}

// Every choice of extremes that a sign pattern makes; the sanitizer looks for overflow beyond the bounds.
TEST(extremes_do_not_overflow)
{
    static const uint16_t tares_q4[] = {0, 16, 800, 32000, 65440, 65520};
    uint32_t seed = 1;
    for (int k = 0; k < 60000; k++) {
        uint16_t counts[BT_ELECTRODES];
        int32_t force[3];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            seed = seed * 1664525u + 1013904223u;
            uint32_t draw = seed >> 16;
            counts[i] = (uint16_t)(draw % 4 == 0   ? 0
                                   : draw % 4 == 1 ? BT_FULL_SCALE_COUNT
                                   : draw % 4 == 2 ? draw % 4096
                                                   : 4090);
        }
        uint16_t tare_q4 = tares_q4[seed >> 28 < 12 ? (seed >> 28) % 6 : 3];
        int32_t e_q4[BT_ELECTRODES];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e_q4[i] = 16 * counts[i] - tare_q4;
        }
        bt_population_force(&bt_population, e_q4, force);
        for (int d = 0; d < 3; d++) {
            assert_true(force[d] > -200000000 && force[d] < 200000000);
        }
    }
}

// A count that a live electrode can have, for any neighbours.
TEST(an_electrode_that_is_estimated_stays_in_its_range)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int up = 0; up <= 1; up++) {
            uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES], completed[BT_ELECTRODES];
            for (int k = 0; k < BT_ELECTRODES; k++) {
                counts[k] = up ? 4089 : 1;
                tare_q4[k] = k == i ? (up ? 16 * 4085 : 16 * 5) : 16 * 2000;
            }
            bt_complete(counts, tare_q4, 1u << i, completed);
            assert_in_range(completed[i], 1, 4089);
            bt_complete(counts, tare_q4, 7u << i % 17, completed); // too many are out: none is made up
            assert_memory_equal(completed, counts, sizeof counts);
        }
    }
}
