// Normal, shear and their half widths: against the formulas in double, at random, at the ends of a FRAME's
// range, and cause by cause.
#include "support.h"

#include "grip_parts.h"
#include "map/population.h"
#include "solve/interval.h"
#include "solve/solve.h"

#include <math.h>

static const bt_margin none = {{0, 0}, {0, 0}};
static const bt_margin some = {{100, 200}, {16, 32}};

static bt_msg_frame grip_of(const int16_t poc_um[3], const int32_t force_100un[3], bt_uncertainty uncertainty)
{
    bt_msg_frame msg;
    for (int d = 0; d < 3; d++) {
        msg.poc_um[d] = poc_um[d];
        msg.force_100un[d] = force_100un[d];
    }
    bt_grip(&uncertainty, &msg);
    return msg;
}

// A point of the core's surface as a board publishes it, in whole um.
static void random_point(uint64_t *seed, int16_t poc_um[3])
{
    double tilt = (double)random_range(seed, -1500, 1500) / 1000, radius = BT_CORE_RADIUS_UM;
    double up = random_range(seed, 0, 1) ? (double)random_range(seed, 0, 1500) / 1000 : 0;
    poc_um[0] = (int16_t)(up > 0 ? lround(radius * sin(up)) : random_range(seed, -16000, 0));
    poc_um[1] = (int16_t)lround(radius * cos(up) * sin(tilt));
    poc_um[2] = (int16_t)lround(-radius * cos(up) * cos(tilt));
}

static double capped_n(int32_t force_100un)
{
    return fmax(-BT_GRIP_MAX_MN / 1e3, fmin(BT_GRIP_MAX_MN / 1e3, force_100un / 1e4));
}

// Rounding error of normal (times 1) and shear (times 2): half a mN of each component, root 3 / 2, and
// of the part itself; in shear also of the normal and of the normal's components. A unit normal is off by
// 0.17 / 1000, as the point is rounded to whole um, and by root 3 / 2 in 2^14.
static double bound_mn(double size_n, int times)
{
    return (.87 + .5) * times + .23 * size_n * times;
}

TEST(both_parts_are_the_formulas)
{
    uint64_t seed = 3;
    double worst = 0;
    for (int k = 0; k < 300000; k++) {
        int16_t poc_um[3];
        int32_t force_100un[3];
        double poc_mm[3], force_n[3], part_n[2], size_n = 0;
        random_point(&seed, poc_um);
        int32_t top = k % 3 == 0 ? INT32_MAX : k % 3 == 1 ? 100000 : 3000;
        for (int d = 0; d < 3; d++) {
            force_100un[d] = (int32_t)random_range(&seed, -top, top);
            poc_mm[d] = poc_um[d] / 1e3;
            force_n[d] = capped_n(force_100un[d]);
            size_n += force_n[d] * force_n[d];
        }
        size_n = sqrt(size_n);
        grip_parts(poc_mm, force_n, part_n);
        bt_msg_frame msg = grip_of(poc_um, force_100un, (bt_uncertainty){.margin = &some});
        worst = fmax(worst, fabs(msg.normal_mn - 1e3 * part_n[0]) / bound_mn(size_n, 1));
        worst = fmax(worst, fabs(msg.shear_mn - 1e3 * part_n[1]) / bound_mn(size_n, 2));
        uint32_t size_mn = (uint32_t)msg.normal_mn + msg.shear_mn;
        assert_int_equal(msg.normal_half_mn, 100 + (16 * size_mn + 128) / 256);
        assert_int_equal(msg.shear_half_mn, 200 + (32 * size_mn + 128) / 256);
    }
    print_message("at worst %.2f of what rounding may leave\n", worst);
    assert_true(worst <= 1);
}

TEST(each_cause_widens_both_by_what_it_says)
{
    const int16_t pad_um[3] = {-4000, 0, -BT_CORE_RADIUS_UM};
    const int32_t press[3] = {10000, 0, 30000};
    const struct {
        bt_uncertainty cause;
        int normal_mn, shear_mn;
    } cases[] = {
        {{.margin = &none}, 0, 0},
        {{.margin = &some}, 100 + 250, 200 + 500},
        {{.margin = &none, .guess_mn = {70, 30}}, 70, 30},
        {{.margin = &none, .noise_q4 = 24}, 24, 24}, // 1.5 counts
        {{.margin = &none, .out = 2}, 500, 500},     // a sixteenth of 4 N for each
        {{.margin = &none, .tare_unconfirmed = true}, 2000, 2000},
        {{.margin = &none, .shear_max_mn = 1000}, 0, 0},
        {{.margin = &none, .shear_max_mn = 900}, 750, 200}, // twice the rest, or a quarter of the normal
        {{.margin = &some, .guess_mn = {70, 30}, .noise_q4 = 24, .out = 1, .tare_unconfirmed = true},
         350 + 70 + 24 + 250 + 2000,
         700 + 30 + 24 + 250 + 2000},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        bt_msg_frame msg = grip_of(pad_um, press, cases[k].cause);
        assert_int_equal(msg.normal_half_mn, cases[k].normal_mn);
        assert_int_equal(msg.shear_half_mn, cases[k].shear_mn);
    }
}

// The half widths of a press with a pull at a place, with pressure and a distance from the normals, less
// those of another map of the same margin.
static void assert_unfelt(int16_t x_um, int32_t normal_mn, int32_t shear_mn, int32_t pressed_mn,
                          uint32_t off_mn, int normal_half_mn, int shear_half_mn)
{
    const int16_t poc_um[3] = {x_um, 0, (int16_t)-lround(sqrt(5080.0 * 5080 - x_um * x_um * (x_um > 0)))};
    const bt_margin copy = bt_population.margin;
    int32_t force_100un[3];
    for (int d = 0; d < 3; d++) {
        const double n = d > 0 || x_um > 0 ? poc_um[d] / 5080.0 : 0;
        const bool pulled = d == (x_um > 0); // across the normal
        force_100un[d] = (int32_t)lround(10 * (shear_mn * pulled - normal_mn * n));
    }
    bt_uncertainty with = {
        .margin = &bt_population.margin, .pressed_mn = pressed_mn, .off_100un = 10 * off_mn};
    bt_msg_frame msg = grip_of(poc_um, force_100un, with);
    bt_msg_frame plain = grip_of(poc_um, force_100un, (bt_uncertainty){.margin = &copy});
    assert_in_range(msg.normal_half_mn - plain.normal_half_mn + 2, normal_half_mn, normal_half_mn + 4);
    assert_in_range(msg.shear_half_mn - plain.shear_half_mn + 2, shear_half_mn, shear_half_mn + 4);
}

TEST(the_population_map_is_unsure_of_pulls_of_light_touches_and_at_the_tip)
{
    assert_unfelt(-4000, 5000, 1000, -1, 900, 0, 0);
    assert_unfelt(-4000, 5000, 3000, -1, 0, 0, 1250);
    assert_unfelt(1024, 5000, 0, -1, 0, 498, 0);
    assert_unfelt(4096, 5000, 0, -1, 0, 996, 0);
    assert_unfelt(2048, 5000, 3000, -1, 0, 1621, 1875);
    assert_unfelt(-4000, 450, 0, -1, 0, 525, 0);
    assert_unfelt(-4000, 250, 200, -1, 0, 525, 93);
}

TEST(pressure_says_what_the_population_map_may_lack_and_which_touch_is_light)
{
    assert_unfelt(-4000, 5000, 0, 5000, 0, 0, 0);
    assert_unfelt(-4000, 500, 0, 250, 0, 325, 0);
    assert_unfelt(-4000, 2000, 0, 6000, 0, 4500, 0);
    assert_unfelt(-4000, 500, 0, 6000, 0, 500 + 8750, 0); // up to 13/8 of 6 N
    assert_unfelt(-4000, 4000, 0, 1000, 0, 4000, 0);
    assert_unfelt(-4000, 3000, 0, 3000, 1000, 1015, 0);
    assert_unfelt(1024, 3000, 0, 3000, 1000, 298 + 507, 0);
    assert_unfelt(2048, 3000, 0, 3000, 1000, 598, 0);
}

TEST(what_is_too_large_saturates_and_what_is_unknown_says_so)
{
    const int16_t pad_um[3] = {-4000, 0, -BT_CORE_RADIUS_UM}, nowhere[3] = {BT_INVALID_I16, 0, 0};
    const int32_t most[3] = {INT32_MAX, -INT32_MAX, INT32_MAX}, unknown[3] = {BT_INVALID_I32, 0, 0};
    const bt_margin largest = {{BT_INVALID_COUNT - 1, BT_INVALID_COUNT}, {BT_MARGIN_SHARE_MAX_Q8, 0}};
    const bt_uncertainty all = {.margin = &largest,
                                .guess_mn = {30300, 30300},
                                .noise_q4 = UINT16_MAX,
                                .out = BT_ELECTRODES,
                                .tare_unconfirmed = true};
    bt_msg_frame msg = grip_of(pad_um, most, all);
    assert_in_range(msg.normal_mn, BT_GRIP_MAX_MN - 10, BT_GRIP_MAX_MN + 10);
    assert_in_range(msg.shear_mn, 52300, 52350); // sqrt(2) of it
    assert_int_equal(msg.normal_half_mn, BT_INVALID_COUNT - 1);
    assert_int_equal(msg.shear_half_mn, BT_INVALID_COUNT);
    for (int k = 0; k < 2; k++) {
        msg = grip_of(k ? nowhere : pad_um, k ? most : unknown, all);
        assert_true(msg.normal_mn == BT_INVALID_COUNT && msg.shear_mn == BT_INVALID_COUNT);
        assert_true(msg.normal_half_mn == BT_INVALID_COUNT && msg.shear_half_mn == BT_INVALID_COUNT);
    }
}

TEST(what_bulges_may_hide_from_lins_gains_ends_at_4_n)
{
    uint32_t guess_mn[2];
    bt_lin_guess(10000, guess_mn);
    assert_true(guess_mn[0] == 1000 && guess_mn[1] == 398);
    bt_lin_guess(303000, guess_mn);
    assert_true(guess_mn[0] == 4000 && guess_mn[1] == 1593);
    bt_population_guess(0, true, 303000, guess_mn);
    assert_true(guess_mn[0] == 30300 && guess_mn[1] == 30300);
    bt_population_guess(256, false, 303000, guess_mn);
    assert_true(guess_mn[0] == 0 && guess_mn[1] == 0);
}
