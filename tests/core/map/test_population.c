// The population map: nothing overflows, rest is 0, mirrored fingers feel mirrored forces, and a poke gets
// Lin's.
#include "keep/settings.h"
#include "map/population.h"
#include "map/population_gen.h"
#include "signal/signals.h"
#include "solve/solve.h"
#include "solve/wrench.h"
#include "support.h"

static const uint8_t mirror[BT_ELECTRODES] = {10, 11, 12, 13, 14, 15, 6,  8,  7, 9,
                                              0,  1,  2,  3,  4,  5,  16, 17, 18};

// The map that the firmware carries is one that it would take from a host, which proves its sums' bounds.
static void the_map_is_as_it_is_opened(void **state)
{
    (void)state;
    bt_map map;
    const bt_map *its = &bt_population;
    assert_int_equal(bt_map_open(&map, its->serial - 4, BT_POPULATION_BYTES), BT_ERROR_OK);
    assert_true(map.axes == its->axes && map.block_count == its->block_count && map.kinds == its->kinds
                && map.gates == its->gates && map.serial == its->serial && map.blocks == its->blocks
                && map.coefficients == its->coefficients);
    assert_false(bt_map_needs_pdc(its));
}

static void force_of(const uint16_t counts[BT_ELECTRODES], uint16_t tare_q4, int32_t force_100un[3])
{
    uint16_t tares_q4[BT_ELECTRODES];
    int32_t e_q4[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        tares_q4[i] = tare_q4;
    }
    bt_signals_q4(counts, tares_q4, e_q4);
    bt_population_force(e_q4, counts, tares_q4, force_100un);
}

static void rest_is_no_force(void **state)
{
    (void)state;
    for (uint32_t count = 0; count <= BT_FULL_SCALE_COUNT; count += 5) {
        uint16_t counts[BT_ELECTRODES];
        int32_t force[3];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            counts[i] = (uint16_t)count;
        }
        force_of(counts, (uint16_t)(16 * count), force);
        for (int d = 0; d < 3; d++) {
            assert_int_equal(force[d], 0);
        }
    }
}

// Every choice of extremes that a sign pattern makes; the sanitizer looks for what the bounds missed.
static void extremes_do_not_overflow(void **state)
{
    (void)state;
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
        force_of(counts, tares_q4[seed >> 28 < 12 ? (seed >> 28) % 6 : 3], force);
        for (int d = 0; d < 3; d++) {
            assert_true(force[d] > -200000000 && force[d] < 200000000);
        }
    }
}

static void a_missing_electrode_counts_as_rest(void **state)
{
    (void)state;
    uint16_t counts[BT_ELECTRODES];
    int32_t missing[3], still[3];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        counts[i] = (uint16_t)(2600 - 11 * i);
    }
    counts[4] = BT_INVALID_COUNT;
    force_of(counts, 16 * 2800, missing);
    counts[4] = 2800;
    force_of(counts, 16 * 2800, still);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(missing[d], still[d]);
    }
}

// The map is symmetric, its rounding is not: half up. Of each of four gated blocks half a unit that is met by
// a gate of at most 2.9 2^13 and divided by 2^8 or more; of 19 rows and eight blocks a unit at most.
#define ROUNDED_100UN (2 * (4 * 46 + BT_ELECTRODES + 8))

static void a_mirrored_finger_feels_the_mirrored_force(void **state)
{
    (void)state;
    uint32_t seed = 7;
    int32_t most = 0;
    for (int k = 0; k < 500; k++) {
        uint16_t counts[BT_ELECTRODES], other[BT_ELECTRODES];
        int32_t force[3], image[3];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            seed = seed * 1664525u + 1013904223u;
            counts[i] = (uint16_t)(2900 - (seed >> 16) % 900);
        }
        for (int i = 0; i < BT_ELECTRODES; i++) {
            other[i] = counts[mirror[i]];
        }
        force_of(counts, 16 * 2800, force);
        force_of(other, 16 * 2800, image);
        assert_in_range(force[0] - image[0] + ROUNDED_100UN, 0, 2 * ROUNDED_100UN);
        assert_in_range(force[1] + image[1] + ROUNDED_100UN, 0, 2 * ROUNDED_100UN);
        assert_in_range(force[2] - image[2] + ROUNDED_100UN, 0, 2 * ROUNDED_100UN);
        most = force[2] > most ? force[2] : most;
    }
    assert_true(most > 10 * ROUNDED_100UN);
}

static void a_poke_keeps_lins_sign_and_size_and_is_told(void **state)
{
    (void)state;
    bt_settings all;
    bt_settings_reset(&all);
    const int32_t gain_nn[3] = {bt_settings_get(&all, BT_SETTING_FORCE_GAIN_X_NN),
                                bt_settings_get(&all, BT_SETTING_FORCE_GAIN_Y_NN),
                                bt_settings_get(&all, BT_SETTING_FORCE_GAIN_Z_NN)};
    const int32_t torque_nn[2] = {0, 0};
    const bt_gains gains = bt_gains_from(gain_nn, torque_nn);
    uint32_t seed = 3;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int deep = 50; deep <= 600; deep += 10) {
            int32_t e_q4[BT_ELECTRODES], lin[3], force[3];
            uint16_t counts[BT_ELECTRODES];
            for (int j = 0; j < BT_ELECTRODES; j++) {
                seed = seed * 1664525u + 1013904223u;
                int32_t noise = deep >= 100 ? (int32_t)(seed >> 29) - 4 : 0; // a sensor's own
                counts[j] = (uint16_t)(2800 + noise - (i == j ? deep : 0));
                e_q4[j] = 16 * ((int32_t)counts[j] - 2800);
            }
            force_of(counts, 16 * 2800, force);
            bt_force(e_q4, &gains, lin);
            uint32_t share = bt_population_share(e_q4);
            assert_true(share < BT_POPULATION_ALL);
            bt_population_mix(share, lin, force);
            assert_true(force[2] > 0 && lin[2] > 0);
            assert_true(3 * force[2] >= lin[2] && force[2] <= 3 * lin[2]);
        }
    }
}

// By division, as it is defined: (sum |e|)^2 / sum e^2 from 3 to 4.5.
static void the_share_is_what_it_is_defined_as(void **state)
{
    (void)state;
    uint32_t seed = 5;
    for (int k = 0; k < 20000; k++) {
        int32_t e_q4[BT_ELECTRODES];
        double sum = 0, energy = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            seed = seed * 1664525u + 1013904223u;
            int32_t size = i < k % 8 ? 8000 + (int32_t)(seed >> 18) : (int32_t)(seed >> 22);
            e_q4[i] = seed & 1 << 12 ? size : -size;
            double beyond = size > 128 ? size - 128 : 0;
            sum += beyond;
            energy += beyond * beyond;
        }
        double wanted = (sum * sum / energy - 3.0) / 1.5;
        wanted = wanted < 0 ? 0 : wanted > 1 ? 1 : wanted;
        double got = bt_population_share(e_q4) / 256.0;
        assert_true(got - wanted < 0.05 && wanted - got < 0.05);
    }
    const int32_t none[BT_ELECTRODES] = {0};
    assert_int_equal(bt_population_share(none), 0);
}

// Whoever gave one axis a gain of his own means Lin's force by his gains, on all axes.
static void any_gain_of_ones_own_takes_the_population_away(void **state)
{
    (void)state;
    static const uint8_t gains[] = {BT_SETTING_FORCE_GAIN_X_NN, BT_SETTING_FORCE_GAIN_Y_NN,
                                    BT_SETTING_FORCE_GAIN_Z_NN};
    bt_settings all;
    bt_settings_reset(&all);
    assert_true(bt_solve_settings_from(&all).population);
    for (int d = 0; d < 3; d++) {
        int32_t gain_nn = bt_settings_get(&all, gains[d]);
        assert_int_equal(bt_settings_set(&all, gains[d], gain_nn + 1), BT_ERROR_OK);
        assert_false(bt_solve_settings_from(&all).population);
        assert_int_equal(bt_settings_set(&all, gains[d], gain_nn), BT_ERROR_OK);
    }
    assert_int_equal(bt_settings_set(&all, BT_SETTING_FORCE_MODEL, BT_FORCE_MODEL_LIN), BT_ERROR_OK);
    assert_false(bt_solve_settings_from(&all).population);
}

// A poke of one electrode, of four at different depths, and a plate: Lin's force, some of both, the map's.
static void what_is_published_is_mixed_by_its_share_and_says_so(void **state)
{
    (void)state;
    static const int deep[3][BT_ELECTRODES] = {
        {[6] = 300}, {[6] = 300, [7] = 250, [8] = 280, [16] = 120}, {[0 ... BT_ELECTRODES - 1] = 200}};
    bt_settings all;
    bt_settings_reset(&all);
    const bt_solve_settings settings = bt_solve_settings_from(&all);
    for (int k = 0; k < 3; k++) {
        uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
        int32_t e_q4[BT_ELECTRODES], lin[3], map[3], force[3], torque[3];
        int16_t poc[3];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            counts[i] = (uint16_t)(2800 - deep[k][i]);
            tare_q4[i] = 16 * 2800;
        }
        bt_signals_q4(counts, tare_q4, e_q4);
        uint32_t share = bt_population_share(e_q4);
        assert_int_equal((share > 0) + (share == BT_POPULATION_ALL), k);
        bt_force(e_q4, &settings.gains, lin);
        bt_population_force(e_q4, counts, tare_q4, map);
        const bt_map_input frame = {.counts = counts, .tare_q4 = tare_q4};
        uint32_t flags = bt_solve_uncalibrated(e_q4, &frame, &settings, BT_WANT_FORCE, poc, force, torque);
        assert_int_equal(flags, BT_FRAME_FLAG_POPULATION | (k < 2 ? BT_FRAME_FLAG_OUTSIDE : 0));
        for (int d = 0; d < 3; d++) {
            double expected = lin[d] + share / 256.0 * (map[d] - lin[d]);
            assert_true(expected - force[d] <= 1.0 && force[d] - expected <= 1.0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_map_is_as_it_is_opened),
        cmocka_unit_test(rest_is_no_force),
        cmocka_unit_test(extremes_do_not_overflow),
        cmocka_unit_test(a_missing_electrode_counts_as_rest),
        cmocka_unit_test(a_mirrored_finger_feels_the_mirrored_force),
        cmocka_unit_test(a_poke_keeps_lins_sign_and_size_and_is_told),
        cmocka_unit_test(the_share_is_what_it_is_defined_as),
        cmocka_unit_test(any_gain_of_ones_own_takes_the_population_away),
        cmocka_unit_test(what_is_published_is_mixed_by_its_share_and_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
