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
    bt_witness moves = {.moves = true};
    for (int k = 0; k < n; k++) {
        verdict = bt_release_judge(&release, &moves, &sweep);
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

// A press of this energy, and what stands for a second of this pressure above the tare.
static bt_witness asked(bt_witness witness, uint32_t uneven_count2, int32_t above, uint8_t still_sweeps)
{
    bt_release release;
    bt_release_begin(&release);
    bt_release_pressure(&release, above);
    for (int k = 0; k < 12; k++) {
        bt_release_sweep sweep = held;
        sweep.uneven_count2 = uneven_count2;
        sweep.above = above;
        sweep.still_sweeps = still_sweeps;
        (void)bt_release_judge(&release, &witness, &sweep);
    }
    return witness;
}

static void pressure_is_a_witness_once_a_press_has_moved_it(void **state)
{
    (void)state;
    const bt_witness unproven = {0}, moves = {.moves = true}, flat = {.flat = true};
    for (int k = 0; k < 3; k++) {
        bt_witness before = k == 0 ? unproven : k == 1 ? moves : flat;
        bt_witness after = asked(before, 100000, 300, 20); // 3 N on a healthy finger
        assert_true(after.moves && !after.flat);
        after = asked(before, 100000, -300, 20); // tared in a grip, and let go
        assert_true(after.moves && !after.flat);
        after = asked(before, 100000, 3, 20); // a count per newton
        assert_true(!after.moves && after.flat);
        after = asked(before, 100000, 3, 0); // real pressure may come a second late
        assert_memory_equal(&after, &before, sizeof before);
        after = asked(before, 5000, 3, 20); // too light to say so
        assert_memory_equal(&after, &before, sizeof before);
    }
}

#define T(name) cmocka_unit_test(name)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_press_goes_on),
        T(each_verdict_has_its_sweep),
        T(pressure_is_a_witness_once_a_press_has_moved_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
