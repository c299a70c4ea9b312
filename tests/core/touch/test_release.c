// What a sweep of a contact says of its end (SPEC.md, Tare), well inside of each condition; courses:
// test_tare*.c.
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

static void a_press_goes_on(void **state)
{
    (void)state;
    assert_int_equal(after(pressed, held, SWEEPS), BT_RELEASE_NO);
}

static void each_verdict_has_its_sweep(void **state)
{
    (void)state;
    bt_release_sweep clean = held, residue = held, shift = held, doubt = held;
    clean.energy_count2 = clean.uneven_count2 = 50;
    clean.above = 0;
    assert_int_equal(after(pressed, clean, 1), BT_RELEASE_CLEAN);
    residue.energy_count2 = residue.uneven_count2 = 800; // of 100000
    residue.above = 0;
    assert_int_equal(after(pressed, residue, 1), BT_RELEASE_RESIDUE);
    residue.still_sweeps = 0;
    assert_int_not_equal(after(pressed, residue, 1), BT_RELEASE_RESIDUE);
    residue = held;
    residue.energy_count2 = residue.uneven_count2 = 5000;
    residue.forgiven_count2 = 6000;
    residue.above = 0;
    assert_int_equal(after(pressed, residue, 1), BT_RELEASE_RESIDUE);
    shift.uneven_count2 = 50; // no pattern, and less pressure than a press makes
    shift.above = 10;
    assert_int_not_equal(after(pressed, shift, 1), BT_RELEASE_SHIFT);
    assert_int_equal(after(pressed, shift, SWEEPS), BT_RELEASE_SHIFT);
    doubt.above = 40; // of 400
    assert_int_equal(after(pressed, doubt, 1), BT_RELEASE_DOUBT);
    bt_release unseen = pressed; // by the pressure: only electrodes that stay back count
    unseen.pdc_peak = 0;
    residue = held;
    residue.energy_count2 = 450;
    residue.uneven_count2 = 0;
    residue.above = 0;
    assert_int_not_equal(after(unseen, residue, 1), BT_RELEASE_RESIDUE);
    assert_int_equal(after(unseen, residue, SWEEPS / 2), BT_RELEASE_RESIDUE);
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
    sweep.above = 0;
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
        T(each_verdict_has_its_sweep),
        T(peaks_are_the_most_there_was),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
