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

// Rounds of a press by the pressure that a finger reads; then what of it must have been pressed.
static bt_release read(int rounds, int32_t above)
{
    bt_release release = {0};
    for (int k = 0; k < rounds; k++) {
        bt_release_pressure(&release, above + k % 2);
    }
    return release;
}

// Sweeps of it, in which the electrodes have this energy.
static bt_witness felt(bt_witness witness, bt_release *release, int sweeps, uint32_t energy_count2)
{
    for (int k = 0; k < sweeps; k++) {
        bt_release_sweep sweep = held;
        sweep.energy_count2 = sweep.uneven_count2 = energy_count2;
        sweep.above = release->above;
        sweep.pressed = bt_release_pressed(release, release->lesser, 0);
        (void)bt_release_judge(release, &witness, &sweep);
    }
    return witness;
}

TEST(electrodes_that_feel_nothing_of_a_press_are_pending_and_silent_in_half_a_second)
{
    const uint32_t noise_of_8_counts = 152;
    for (int32_t above = 400; above <= BT_FULL_SCALE_COUNT; above *= 2) {
        bt_release release = read(2, above);
        bt_witness witness = felt((bt_witness){0}, &release, 5, noise_of_8_counts);
        assert_true(bt_release_pending(&release) && !bt_witness_silent(&witness));
        witness = felt(witness, &release, 1, noise_of_8_counts);
        assert_true(bt_witness_silent(&witness) && witness.moves && !witness.flat);
        bt_release light = read(2, 40); // too little to be felt ends nothing
        witness = felt(witness, &light, 100, noise_of_8_counts);
        assert_true(bt_witness_silent(&witness) && !bt_release_pending(&light));
        witness = felt(witness, &release, 1, (uint32_t)(above * above));
        assert_false(bt_release_pending(&release) || bt_witness_silent(&witness));
    }
}

TEST(the_least_that_electrodes_feel_is_not_silent)
{
    for (int32_t above = 0; above <= BT_FULL_SCALE_COUNT; above += 60) {
        bt_release release = read(2, above);
        bt_witness witness = felt((bt_witness){0}, &release, 100, (uint32_t)(above * above) / 24);
        assert_false(bt_release_pending(&release) || witness.silent != 0);
    }
    bt_release tip = read(2, 400); // a narrow one, beside the electrodes: a 120th
    bt_witness witness = felt((bt_witness){0}, &tip, 100, 900);
    assert_false(bt_release_pending(&tip) || witness.silent != 0);
    for (int32_t above = 0; above < 57; above++) { // pressure that crept
        bt_release light = read(2, above);
        witness = felt((bt_witness){0}, &light, 100, 0);
        assert_false(bt_release_pending(&light) || witness.silent != 0);
    }
}

TEST(pressure_that_a_press_leaves_is_no_press)
{
    bt_release release = read(2, 920);
    bt_witness witness = felt((bt_witness){0}, &release, 10, 900 * 900);
    for (int32_t left = 300; left > 0; left -= 10) { // a third of it
        bt_release_pressure(&release, left);
        bt_release_pressure(&release, left);
        assert_int_equal(bt_release_pressed(&release, release.lesser, 0), 0);
        witness = felt(witness, &release, 1, 20);
        assert_false(bt_release_pending(&release) || witness.silent != 0);
    }
    bt_release warm = read(2, 300);
    assert_int_equal(bt_release_pressed(&warm, 300, 210), 0);
    assert_true(bt_release_pressed(&warm, 300, 110) > 0);
    bt_release found = read(2, 300);
    found.found = true;
    assert_int_equal(bt_release_pressed(&found, 300, 0), 0);
}

TEST(pressure_that_repeats_one_word_condemns_no_electrode)
{
    bt_release release = read(2, 900);
    bt_witness witness = felt((bt_witness){0}, &release, 5, 900 * 900);
    for (int k = 0; k < BT_REPEATS_ROUNDS; k++) {
        assert_true(bt_release_pressed(&release, release.lesser, 0) > 0);
        bt_release_pressure(&release, 901);
    }
    witness = felt(witness, &release, 100, 0);
    assert_false(bt_release_pending(&release) || witness.silent != 0);
    bt_release_pressure(&release, 902);
    assert_true(bt_release_pressed(&release, release.lesser, 0) > 0);
}
