// The population map: nothing overflows, rest is 0, mirrored fingers feel mirrored forces, and what is unlike
// the training goes along the normals.
#include "keep/settings.h"
#include "map/estimate.h"
#include "map/population.h"
#include "map/population_gen.h"
#include "solve/interval.h"
#include "solve/solve.h"
#include "solve/wrench.h"
#include "support.h"

#include <math.h>

static const uint8_t mirror[BT_ELECTRODES] = {10, 11, 12, 13, 14, 15, 6,  8,  7, 9,
                                              0,  1,  2,  3,  4,  5,  16, 17, 18};

// The map that the firmware carries is one that it would take from a host, which proves its sums' bounds.
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

// Every choice of extremes that a sign pattern makes; the sanitizer looks for what the bounds missed.
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
        bt_population_force(e_q4, force);
        for (int d = 0; d < 3; d++) {
            assert_true(force[d] > -200000000 && force[d] < 200000000);
        }
    }
}

// The map is symmetric, its rounding is not: half up. Of each of four gated blocks half a unit that is met by
// a gate of at most 2.9 2^13 and divided by 2^6 or more; of six blocks a unit at most.
#define ROUNDED_100UN (2 * (4 * 186 + 6))

static void signals_of(const int32_t e[BT_ELECTRODES], int eighths, int32_t e_q4[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = 2 * eighths * e[i];
    }
}

// A flat plate on the middle of the pad, in counts: what lies under it is compressed, the sides bulge.
static const int32_t plate[BT_ELECTRODES] = {300, 0, 100, 300, 100, 300, -100, -200, -200, -400,
                                             300, 0, 100, 300, 100, 300, -800, 0,    100};

// As it is defined, by division: how far the map is off the normals, and how much of 1024 counts is there.
TEST(the_likeness_is_what_it_is_defined_as)
{
    uint32_t seed = 5;
    int mixed = 0;
    for (int k = 0; k < 20000; k++) {
        int32_t e_q4[BT_ELECTRODES], force[3], by_map[3];
        double sum = 0, pressed = 0, off = 0, along[3] = {0, 0, 0};
        signals_of(plate, 1 + k % 12, e_q4);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            seed = seed * 1664525u + 1013904223u;
            e_q4[i] += ((int32_t)(seed >> 16) - 32768) * (k % 7) / 16;
            double size = fabs(e_q4[i] / 16.0) - 8;
            size = size < 0 ? 0 : size > 256 ? 256 + (size - 256) / 4 : size;
            sum += size;
            if (e_q4[i] < 0) {
                const int16_t *r = bt_electrode_um[i];
                pressed += size;
                along[0] -= .6 * size * (r[0] > 0 ? r[0] : 0);
                along[1] -= .6 * size * r[1];
                along[2] -= size * r[2];
            }
        }
        along[2] += sum / 32 * BT_CORE_RADIUS_UM;
        double length = hypot(hypot(along[0], along[1]), along[2]), firm_100un = 12.5 * sum;
        double gain = fmin(fmax(sum / 2520.6, .4), 1);
        bt_likeness result = bt_population_force(e_q4, force);
        bt_map_results(&bt_population, e_q4, NULL, NULL, 0, BT_MAP_AXES_FORCE, by_map);
        for (int d = 0; d < 3; d++) {
            along[d] *= firm_100un / length;
            off = fmax(off, fabs(by_map[d] - along[d]) / firm_100un);
        }
        double like = (1.375 - off) * 2, firm = (sum - 1500) / 1024, share = like < firm ? like : firm;
        share = share < 0 ? 0 : share > 1 ? 1 : share;
        assert_true(fabs(result.share / 256.0 - share) < 0.02);
        assert_true(fabs(result.strength_100un - gain * firm_100un)
                    <= 12.5 * BT_ELECTRODES / 16 + 2 + firm_100un / 256); // a step of the gain
        for (int d = 0; d < 3; d++) {
            assert_true(fabs(result.otherwise_100un[d] - along[d]) < 0.01 * firm_100un);
            double part = floor(result.share * result.gain / 256.0);
            double expected = part * by_map[d] + (result.gain - part) * result.otherwise_100un[d];
            assert_true(fabs(expected / 256 - force[d]) <= 0.5 + 1e-6);
        }
        if (fabs(off - 2) > 0.01 && fabs(8 * pressed - sum) > 8 && (result.share == 0 || share < 0.98)) {
            assert_true(result.outside == (sum < 64 || off > 2 || 8 * pressed < sum));
        }
        mixed += result.share > 0 && result.share < BT_POPULATION_ALL;
    }
    assert_true(mixed > 1000);
    const int32_t none[BT_ELECTRODES] = {0};
    int32_t force[3];
    bt_likeness at_rest = bt_population_force(none, force);
    assert_true(at_rest.share == 0 && at_rest.outside && at_rest.strength_100un == 0);
}

// A map fitted to presses of a finger has the same blocks, and extrapolates beyond these presses likewise.
TEST(a_map_of_the_same_blocks_is_judged_alike)
{
    bt_map same = bt_population, other = bt_population;
    bt_solve_settings settings = bt_solve_settings_from(&(bt_settings){0});
    other.gates |= 1u << BT_MAP_GATE_XX;
    assert_true(bt_population_like(&same) && !bt_population_like(&other));
    uint32_t seed = 1, outside = 0;
    for (int k = 0; k < 2000; k++) {
        uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
        int32_t e_q4[BT_ELECTRODES], force[2][3], torque[3], torsion;
        uint32_t guess[2][2], flags[2];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            seed = seed * 1664525u + 1013904223u;
            tare_q4[i] = 16 * 2000;
            counts[i] = (uint16_t)(2000 + ((int32_t)(seed >> 16) - 32768) * (k % 20) / 400);
            e_q4[i] = 16 * counts[i] - tare_q4[i];
        }
        int16_t poc[3];
        bt_map_input frame = {counts, tare_q4, 0};
        settings.map = &same;
        flags[0] =
            bt_solve_mapped(e_q4, &frame, &settings, BT_WANT_ALL, poc, force[0], torque, &torsion, guess[0]);
        flags[1] = bt_solve(e_q4, &settings, BT_WANT_ALL, poc, force[1], torque, guess[1]);
        assert_int_equal(flags[0] | BT_FRAME_FLAG_POPULATION, flags[1]);
        assert_memory_equal(force[0], force[1], sizeof force[0]);
        assert_memory_equal(guess[0], guess[1], sizeof guess[0]);
        outside += flags[0] & BT_FRAME_FLAG_OUTSIDE ? 1 : 0;
    }
    assert_in_range(outside, 100, 1900);
}

TEST(a_mirrored_finger_is_as_like)
{
    uint32_t seed = 9;
    for (int k = 0; k < 5000; k++) {
        int32_t e_q4[BT_ELECTRODES], image_q4[BT_ELECTRODES], force[3], mirrored[3];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            seed = seed * 1664525u + 1013904223u;
            e_q4[i] = ((int32_t)(seed >> 16) - 32768) >> k % 4;
        }
        for (int i = 0; i < BT_ELECTRODES; i++) {
            image_q4[i] = e_q4[mirror[i]];
        }
        bt_likeness result = bt_population_force(e_q4, force),
                    image = bt_population_force(image_q4, mirrored);
        uint32_t off = (BT_POPULATION_ALL * 2 * ROUNDED_100UN / (1 + result.strength_100un)) + 1;
        assert_in_range(result.share + off - image.share, 0, 2 * off); // by the rounding of the map's force
        assert_int_equal(result.strength_100un, image.strength_100un);
        assert_int_equal(result.otherwise_100un[0], image.otherwise_100un[0]);
        assert_int_equal(result.otherwise_100un[1], -image.otherwise_100un[1]);
        assert_int_equal(result.otherwise_100un[2], image.otherwise_100un[2]);
    }
}

static uint32_t published(const int32_t e_q4[BT_ELECTRODES], int32_t force_100un[3])
{
    bt_settings all;
    bt_settings_reset(&all);
    const bt_solve_settings settings = bt_solve_settings_from(&all);
    int16_t poc[3];
    int32_t torque[3];
    uint32_t guess_mn[2];
    return bt_solve(e_q4, &settings, BT_WANT_FORCE, poc, force_100un, torque, guess_mn);
}

// Nothing in the training is like a point that presses on one electrode or between two; the skin's normal
// there, at most 45 degrees off, is what is known.
TEST(a_poke_presses_in_along_the_skins_normal)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int other = 0; other < BT_ELECTRODES; other++) {
            const int16_t *r = bt_electrode_um[i], *s = bt_electrode_um[other];
            if (hypot(hypot(r[0] - s[0], r[1] - s[1]), r[2] - s[2]) > 5000) {
                continue; // too far for a point
            }
            for (int deep = 50; deep <= 600; deep += 10) {
                int32_t e_q4[BT_ELECTRODES] = {0}, force[3];
                e_q4[i] -= 8 * deep;
                e_q4[other] -= 8 * deep;
                uint32_t flags = published(e_q4, force);
                double n[3] = {0, 0, 0}, along = 0;
                for (int d = 0; d < 3; d++) {
                    n[d] = d == 0 ? (r[0] > 0 ? r[0] : 0) + (s[0] > 0 ? s[0] : 0) : r[d] + s[d];
                    along -= n[d] * force[d];
                }
                double size = hypot(hypot(force[0], force[1]), force[2]);
                assert_true(along > 0.7 * size * hypot(hypot(n[0], n[1]), n[2]) && force[2] > 0);
                assert_true(flags & BT_FRAME_FLAG_POPULATION);
            }
        }
    }
}

// Whoever gave one axis a gain of his own means Lin's force by his gains, on all axes.
TEST(any_gain_of_ones_own_takes_the_population_away)
{
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

// A plate that touches, one between, and one that presses: along the normals, some of both, the map's.
TEST(what_is_guessed_goes_as_the_maps_share_grows)
{
    static const int eighths[] = {3, 5, 8};
    for (int k = 0; k < 3; k++) {
        int32_t e_q4[BT_ELECTRODES], force[3];
        uint32_t guess_mn[2];
        signals_of(plate, eighths[k], e_q4);
        bt_likeness result = bt_population_force(e_q4, force);
        assert_int_equal((result.share > 0) + (result.share == BT_POPULATION_ALL), k);
        assert_int_equal(published(e_q4, force), BT_FRAME_FLAG_POPULATION);
        assert_true(force[2] > 0);
        bt_population_guess(result.share, result.outside, result.strength_100un, guess_mn);
        double away = (256.0 - result.share) / 256 * result.strength_100un / 10;
        assert_true(fabs(guess_mn[0] - .4 * away) < 2 + .003 * away
                    && fabs(guess_mn[1] - .3 * away) < 2 + .003 * away);
        assert_int_equal(bt_strength_100un(e_q4) * result.gain >> 8, result.strength_100un);
    }
}

// Where nothing is compressed, no direction is known: the contact is beyond the electrodes.
TEST(what_only_bulges_is_outside)
{
    int32_t e_q4[BT_ELECTRODES], force[3];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = i % 2 == 0 ? 16 * 200 : -16 * 12;
    }
    assert_true(published(e_q4, force) & BT_FRAME_FLAG_OUTSIDE);
}

// Whatever its neighbours say: a count that a live electrode can have.
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

int main(void)
{
    return run_all(NULL, NULL);
}
