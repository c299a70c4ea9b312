// When pressure shows that a tare was taken in a hold (SPEC.md, Tare), well inside of each condition.
#include "support.h"

#include "touch/judge.h"

#define REST 3000
#define PDC  1000

typedef struct {
    bt_baseline base;
    bt_lanes smooth;
    int32_t pdc_peak;
    int32_t cooled;
} finger;

// Tared at REST; the first n electrodes now read `up` counts more, and the pressure is `below` the tare.
static finger reading(int n, int up, int below)
{
    finger read = {.base = {.pdc_q16 = PDC << 16}};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        read.base.electrode_q16[i] = REST << 16;
        read.smooth.lane[i] = (uint16_t)(REST + (i < n ? up : 0));
    }
    read.smooth.lane[BT_LANE_PDC] = (uint16_t)(PDC - below);
    return read;
}

static bool inverted(finger read)
{
    return bt_inverted(&read.smooth, &read.base, bt_pdc_missing_max(read.pdc_peak) + read.cooled);
}

TEST(less_pressure_than_at_rest_is_no_touch)
{
    for (int up = -30; up <= 30; up += 60) { // pressed skin bulges elsewhere: either may prevail
        assert_true(inverted(reading(5, up, 30)));
        assert_false(inverted(reading(5, up, 5)));
        assert_false(inverted(reading(1, up / 10, 30))); // next to nothing
        finger after_press = reading(5, up, 60);
        after_press.pdc_peak = 400;
        assert_true(inverted(after_press));
        after_press.pdc_peak = 1600; // a remainder of the press may be
        assert_false(inverted(after_press));
        finger colder = reading(5, up, 30); // a degree, which may have taken as much from pressure
        colder.cooled = 33;
        assert_false(inverted(colder));
        finger unknown = reading(5, up, 30);
        unknown.base.pdc_q16 = BT_TARE_UNKNOWN;
        assert_false(inverted(unknown));
    }
}

TEST(electrodes_without_a_tare_or_a_word_say_nothing)
{
    finger pressed = reading(1, 60, 30);
    assert_true(inverted(pressed));
    finger silent = pressed;
    silent.smooth.lane[0] = BT_FULL_SCALE_COUNT + 1;
    assert_false(inverted(silent));
    silent = pressed;
    silent.base.electrode_q16[0] = BT_TARE_UNKNOWN;
    assert_false(inverted(silent));
}
