// Each condition under which a contact ends, at its edge: sweeps by hand, against SPEC.md, Tare.
#include "support.h"

#include "touch/release.h"

#define SWEEPS 120 // more than any condition waits for

// A sweep that ends nothing: pressure well above, still, and as strong as the press.
static const bt_release_sweep held = {.energy_count2 = 100000,
                                      .uneven_count2 = 100000,
                                      .pressure = true,
                                      .above = 200,
                                      .still_sweeps = 255,
                                      .level_sweeps = 255};

static const bt_release pressed = {.energy_peak = 100000, .uneven_peak = 100000, .pdc_peak = 400};

// The verdict on the n-th of sweeps that are all the same.
static bt_release_verdict after(bt_release release, bt_release_sweep sweep, int n)
{
    bt_release_verdict verdict = BT_RELEASE_NO;
    for (int k = 0; k < n; k++) {
        verdict = bt_release_judge(&release, &sweep);
    }
    return verdict;
}

// How many of them it takes; 0: more than SWEEPS.
static int sweeps_until(bt_release_verdict wanted, bt_release release, bt_release_sweep sweep)
{
    for (int n = 1; n <= SWEEPS; n++) {
        if (bt_release_judge(&release, &sweep) == wanted) {
            return n;
        }
    }
    return 0;
}

static void a_press_goes_on(void **state)
{
    (void)state;
    assert_int_equal(after(pressed, held, SWEEPS), BT_RELEASE_NO);
}

static void below_four_hundred_and_with_the_pressure_back_it_is_over(void **state)
{
    (void)state;
    bt_release_sweep sweep = held;
    sweep.still_sweeps = 0; // nothing else is asked
    sweep.energy_count2 = 399;
    sweep.above = 3;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_CLEAN);
    sweep.above = 4;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_NO);
    sweep.pressure = false;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_CLEAN);
    sweep.energy_count2 = 400;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_NO);
    sweep.pressure = true;
    sweep.above = 3;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_NO);
}

// A 40th of the pressure's peak, but four counts at least and ten at most; a 64th of the energy's.
static void what_a_press_leaves_is_a_share_of_it(void **state)
{
    (void)state;
    static const int32_t peak_rest[][2] = {{24, 4},  {199, 4},  {200, 5},  {239, 5},
                                           {320, 8}, {400, 10}, {4000, 10}};
    for (size_t k = 0; k < sizeof peak_rest / sizeof *peak_rest; k++) {
        bt_release release = pressed;
        bt_release_sweep sweep = held;
        release.pdc_peak = peak_rest[k][0];
        sweep.energy_count2 = 100000 / 64 - 1;
        sweep.above = peak_rest[k][1] - 1;
        assert_int_equal(after(release, sweep, 1), BT_RELEASE_RESIDUE);
        sweep.above++;
        assert_int_not_equal(after(release, sweep, 1), BT_RELEASE_RESIDUE);
    }
    bt_release_sweep sweep = held;
    sweep.above = 0;
    sweep.energy_count2 = 100000 / 64;
    assert_int_not_equal(after(pressed, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.forgiven_count2 = 1; // is added to it
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.still_sweeps = 5;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.still_sweeps = 4;
    assert_int_not_equal(after(pressed, sweep, 1), BT_RELEASE_RESIDUE);
    // Of a weak press 400, which alone would be CLEAN; and 200 is nothing but noise, however strong it was.
    bt_release weak = pressed;
    weak.energy_peak = weak.uneven_peak = 6400;
    sweep = held;
    sweep.above = 0;
    sweep.energy_count2 = 400;
    sweep.forgiven_count2 = 1;
    assert_int_equal(after(weak, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.energy_count2 = 401;
    assert_int_not_equal(after(weak, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.uneven_count2 = 200;
    assert_int_equal(after(weak, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.uneven_count2 = 201;
    assert_int_not_equal(after(weak, sweep, 1), BT_RELEASE_RESIDUE);
}

// Pressure that saw a press of 24 counts is a witness of it, or of any that was below 4 * 6000.
static void without_a_witness_only_electrodes_that_are_back_for_a_second_count(void **state)
{
    (void)state;
    bt_release release = pressed;
    bt_release_sweep sweep = held;
    release.pdc_peak = 23;
    release.uneven_peak = 24000;
    sweep.uneven_count2 = 0;
    sweep.energy_count2 = 450; // below the share of a press that had a witness
    sweep.above = 3;
    sweep.forgiven_count2 = 1000; // says nothing of it
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, sweep), 12);
    release.quiet_sweeps = 250;
    sweep.uneven_count2 = 200;
    assert_int_not_equal(after(release, sweep, 1), BT_RELEASE_RESIDUE);
    release.uneven_peak = 23999;
    release.quiet_sweeps = 0;
    assert_int_equal(after(release, sweep, 1), BT_RELEASE_RESIDUE);
    release.uneven_peak = 24000;
    release.pdc_peak = 24;
    assert_int_equal(after(release, sweep, 1), BT_RELEASE_RESIDUE);
    sweep.pressure = false; // the energy has fallen to a quarter: quiet, and drift is forgiven
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, sweep), 12);
    release.energy_peak = 1804;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, sweep), 12);
    release.energy_peak = 1803;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, sweep), 0);
}

// Skin that settled: the pressure never knew of a touch, has been back for a second, and little is left.
static void what_the_pressure_never_knew_of_is_no_touch(void **state)
{
    (void)state;
    bt_release_sweep sweep = held;
    bt_release release = pressed;
    release.pdc_peak = 6;
    release.uneven_peak = 7000;
    sweep.above = 3;
    sweep.still_sweeps = 12;
    sweep.energy_count2 = sweep.uneven_count2 = 5999;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, sweep), 12);
    bt_release more = release;
    more.pdc_peak = 7;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, more, sweep), 0);
    bt_release_sweep other = sweep;
    other.still_sweeps = 11;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, other), 0);
    other = sweep;
    other.energy_count2 = 6000;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, other), 0);
    other.forgiven_count2 = 1;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, other), 12);
    other = sweep;
    other.above = 4;
    assert_int_equal(sweeps_until(BT_RELEASE_RESIDUE, release, other), 0);
}

// Without a pattern and with less pressure than a press makes: after a second of what was never one, after
// eight of what was.
static void what_has_no_pattern_is_a_shift(void **state)
{
    (void)state;
    bt_release_sweep sweep = held;
    bt_release release = pressed;
    release.pdc_peak = 23;
    sweep.uneven_count2 = 199;
    sweep.above = 23;
    sweep.level_sweeps = 18;
    sweep.still_sweeps = 12;
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, sweep), 12);
    release.pdc_peak = 24;
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, sweep), 100);
    release.pdc_peak = 23;
    bt_release_sweep other = sweep;
    other.above = 24;
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, other), 0);
    other.pressure = false; // then it may have been a press
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, other), 100);
    other = sweep;
    other.uneven_count2 = 200;
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, other), 0);
    other = sweep;
    other.level_sweeps = 17;
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, other), 0);
    other = sweep;
    other.still_sweeps = 11;
    assert_int_equal(sweeps_until(BT_RELEASE_SHIFT, release, other), 0);
}

// Two counts a second are what a slow load makes.
static void pressure_that_rises_begins_the_count_of_a_shift_anew(void **state)
{
    (void)state;
    bt_release_sweep sweep = held;
    bt_release release = {0};
    sweep.uneven_count2 = 0;
    for (int n = 1; n <= 300; n++) {
        sweep.above = n == 1 ? 10 : 12;
        (void)bt_release_judge(&release, &sweep);
        assert_int_equal(release.even_sweeps, n < 255 ? n : 255);
        assert_int_equal(release.even_above, 10);
    }
    sweep.above = 13;
    (void)bt_release_judge(&release, &sweep);
    assert_int_equal(release.even_sweeps, 1);
    assert_int_equal(release.even_above, 13);
    sweep.pressure = false; // nothing to rise
    sweep.above = 100;
    (void)bt_release_judge(&release, &sweep);
    assert_int_equal(release.even_sweeps, 2);
    sweep.uneven_count2 = 200;
    (void)bt_release_judge(&release, &sweep);
    assert_int_equal(release.even_sweeps, 0);
}

// Fallen to less than a quarter, or the pressure back for two seconds, and still for 400 ms.
static void what_has_fallen_far_is_in_doubt(void **state)
{
    (void)state;
    bt_release_sweep sweep = held;
    sweep.still_sweeps = 5;
    sweep.above = 99;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_DOUBT);
    sweep.above = 100;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_NO);
    sweep.above = 99;
    sweep.still_sweeps = 4;
    assert_int_equal(after(pressed, sweep, 1), BT_RELEASE_NO);
    // A press below 24 counts, or without pressure, is judged by its energy.
    sweep.still_sweeps = 5;
    bt_release release = pressed;
    for (int blind = 0; blind < 2; blind++) {
        release.pdc_peak = blind ? 400 : 23;
        sweep.pressure = !blind;
        sweep.above = 30;
        sweep.energy_count2 = 24999;
        assert_int_equal(after(release, sweep, 1), BT_RELEASE_DOUBT);
        sweep.energy_count2 = 25000;
        assert_int_equal(after(release, sweep, 1), BT_RELEASE_NO);
    }
    sweep = held;
    release = pressed;
    release.pdc_peak = 24;
    sweep.still_sweeps = 5;
    sweep.above = 6;
    assert_int_equal(after(release, sweep, SWEEPS), BT_RELEASE_NO);
    release.pdc_peak = 15; // a witness below 24000; three counts are quiet and no fall of energy
    release.uneven_peak = release.energy_peak = 20000;
    sweep.above = 3;
    sweep.energy_count2 = sweep.uneven_count2 = 20000;
    assert_int_equal(sweeps_until(BT_RELEASE_DOUBT, release, sweep), 25);
    release.uneven_peak = 24000; // no witness
    assert_int_equal(sweeps_until(BT_RELEASE_DOUBT, release, sweep), 0);
}

static void peaks_are_the_most_there_was(void **state)
{
    (void)state;
    bt_release release;
    memset(&release, 0xFF, sizeof release);
    bt_release_begin(&release);
    assert_true(release.energy_peak == 0 && release.uneven_peak == 0 && release.pdc_peak == 0);
    assert_true(release.quiet_sweeps == 0 && release.even_sweeps == 0);
    static const int above[] = {-5, 3, 9, 4}, peak[] = {0, 3, 9, 9};
    for (int k = 0; k < 4; k++) {
        bt_release_sweep sweep = held;
        sweep.energy_count2 = (uint32_t)(1000 + above[k]);
        sweep.uneven_count2 = (uint32_t)(500 - above[k]);
        (void)bt_release_judge(&release, &sweep);
        bt_release_pressure(&release, above[k]);
        assert_int_equal(release.pdc_peak, peak[k]);
        assert_int_equal(release.energy_peak, k == 0 ? 995 : 1000 + peak[k]);
        assert_int_equal(release.uneven_peak, 505);
    }
    // Quiet sweeps are in a row, and saturate.
    bt_release_sweep sweep = held;
    sweep.above = 3;
    for (int n = 1; n <= 300; n++) {
        (void)bt_release_judge(&release, &sweep);
        assert_int_equal(release.quiet_sweeps, n < 255 ? n : 255);
    }
    (void)bt_release_judge(&release, &held);
    assert_int_equal(release.quiet_sweeps, 0);
}

#define T(name) cmocka_unit_test(name)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_press_goes_on),
        T(below_four_hundred_and_with_the_pressure_back_it_is_over),
        T(what_a_press_leaves_is_a_share_of_it),
        T(without_a_witness_only_electrodes_that_are_back_for_a_second_count),
        T(what_the_pressure_never_knew_of_is_no_touch),
        T(what_has_no_pattern_is_a_shift),
        T(pressure_that_rises_begins_the_count_of_a_shift_anew),
        T(what_has_fallen_far_is_in_doubt),
        T(peaks_are_the_most_there_was),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
