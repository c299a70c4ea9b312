// When pressure is a witness of touches (SPEC.md, Tare), well inside of each condition; a contact's end by
// the sweep: test_tare*.c.
#include "support.h"

#include "touch/release.h"
#include "wire/sensor_gen.h"

// A sweep that ends nothing: pressure well above, still, and as strong as the press.
static const bt_release_sweep held = {.energy_count2 = 100000,
                                      .uneven_count2 = 100000,
                                      .pressure = true,
                                      .above = 200,
                                      .still_sweeps = 255,
                                      .level_sweeps = 255};

// A press of this energy, and a sum that stands for a second of this pressure above the tare.
static bt_witness asked(bt_witness witness, uint32_t uneven_count2, int32_t above, uint8_t still_sweeps)
{
    bt_release release = {0};
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

TEST(pressure_is_a_witness_once_a_press_has_moved_it)
{
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

// Sweeps of a press that pressure feels with so many counts, and the electrodes with this energy.
static bt_witness felt(bt_witness witness, int sweeps, uint32_t energy_count2, int32_t pressed)
{
    bt_release release = {0};
    bt_release_pressure(&release, pressed);
    for (int k = 0; k < sweeps; k++) {
        bt_release_sweep sweep = held;
        sweep.energy_count2 = sweep.uneven_count2 = energy_count2;
        sweep.above = sweep.pressed = pressed;
        (void)bt_release_judge(&release, &witness, &sweep);
    }
    return witness;
}

TEST(electrodes_that_feel_nothing_of_a_press_are_told_at_once_and_silent_in_half_a_second)
{
    const bt_witness none = {0};
    for (int32_t pressed = 110; pressed <= BT_FULL_SCALE_COUNT; pressed *= 2) { // 1.1 N; noise of 8 counts
        bt_witness witness = felt(none, 1, 152, pressed);
        assert_true(witness.unfelt && !bt_witness_silent(&witness));
        witness = felt(witness, 1, (uint32_t)(pressed * pressed), pressed);
        assert_false(witness.unfelt || witness.silent != 0);
        witness = felt(none, 5, 152, pressed);
        assert_false(bt_witness_silent(&witness));
        witness = felt(none, 6, 152, pressed);
        assert_true(bt_witness_silent(&witness) && witness.moves && !witness.flat);
        witness = felt(witness, 100, 152, 40); // too little to be felt ends nothing
        assert_true(bt_witness_silent(&witness) && !witness.unfelt);
        witness = felt(witness, 1, 100000, 300);
        assert_false(witness.unfelt || bt_witness_silent(&witness));
    }
}

TEST(the_least_that_electrodes_feel_is_not_silent)
{
    const bt_witness none = {0};
    for (int32_t pressed = 0; pressed <= BT_FULL_SCALE_COUNT; pressed += 60) {
        bt_witness witness = felt(none, 100, (uint32_t)(pressed * pressed) / 48, pressed);
        assert_false(witness.unfelt || witness.silent != 0);
    }
    bt_witness witness = felt(none, 100, 303, 287); // a narrow tip between electrodes
    assert_true(witness.unfelt && witness.silent == 0);
    for (int32_t pressed = 0; pressed < 48; pressed++) { // pressure that crept
        witness = felt(none, 100, 0, pressed);
        assert_false(witness.unfelt || witness.silent != 0);
    }
}

TEST(pressure_that_crept_in_a_long_press_and_stays_is_no_press)
{
    bt_release release = {0};
    bt_witness witness = {0};
    bt_release_pressure(&release, 920); // 8 N for minutes, let go
    for (int k = 0; k < 100; k++) {
        bt_release_sweep sweep = held;
        sweep.energy_count2 = sweep.uneven_count2 = 20;
        sweep.above = sweep.pressed = 120;
        (void)bt_release_judge(&release, &witness, &sweep);
    }
    assert_int_equal(witness.silent, 0);
}

int main(void)
{
    return run_all(NULL, NULL);
}
