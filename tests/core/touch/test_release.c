// When pressure is a witness of touches (SPEC.md, Tare), well inside of each condition; a contact's end by
// the sweep: test_tare*.c.
#include "support.h"

#include "touch/release.h"

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

int main(void)
{
    return run_all(NULL, NULL);
}
