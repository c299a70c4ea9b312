// When a tare is undone or lost (SPEC.md, Tare), well inside of each condition.
#include "support.h"

#include "touch/inverted.h"

#define REST 3000
#define PDC  1000

typedef struct {
    bt_tare_change change;
    bt_baseline base;
    bt_lanes smooth;
    int32_t pdc_peak;
    bool colder;
} finger;

// Tared at REST, where the tare before was `change` counts lower on the first n electrodes; they now read as
// many counts less than the tare as `now` says, and the pressure is `below` its own.
static finger tared(int n, int change, int now, int below)
{
    finger its = {.base = {.pdc_q16 = PDC << 16}};
    bt_baseline before = its.base;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        its.base.electrode_q16[i] = REST << 16;
        before.electrode_q16[i] = (uint32_t)(REST - (i < n ? change : 0)) << 16;
        its.smooth.lane[i] = (uint16_t)(REST - (i < n ? now : 0));
    }
    its.smooth.lane[BT_LANE_PDC] = (uint16_t)(PDC - below);
    bt_inverted_note(&its.change, &before, &its.base);
    return its;
}

static bt_tare_doubt judged(finger *its)
{
    return bt_inverted_judge(&its->change, &its->smooth, &its->base, its->pdc_peak, its->colder);
}

// The verdict of the third round; the two before it must not say anything.
static bt_tare_doubt verdict(finger its)
{
    assert_int_equal(judged(&its), BT_TARE_STANDS);
    assert_int_equal(judged(&its), BT_TARE_STANDS);
    return judged(&its);
}

static void three_rounds_in_a_row_must_say_so(void **state)
{
    (void)state;
    finger its = tared(4, 20, 20, 30);
    finger good = tared(4, 20, 20, 0);
    assert_int_equal(verdict(its), BT_TARE_UNDO);
    assert_int_equal(judged(&its), BT_TARE_STANDS);
    assert_int_equal(judged(&its), BT_TARE_STANDS);
    its.smooth.lane[BT_LANE_PDC] = good.smooth.lane[BT_LANE_PDC];
    assert_int_equal(judged(&its), BT_TARE_STANDS);
    its.smooth.lane[BT_LANE_PDC] = PDC - 30;
    assert_int_equal(verdict(its), BT_TARE_UNDO);
}

static void each_condition_must_hold(void **state)
{
    (void)state;
    assert_int_equal(verdict(tared(4, 20, 20, 30)), BT_TARE_UNDO);
    assert_int_equal(verdict(tared(4, 20, 20, 2)), BT_TARE_STANDS); // pressure is where it was
    assert_int_equal(verdict(tared(4, 20, -20, 30)), BT_TARE_LOSE); // the change the right way up
    assert_int_equal(verdict(tared(1, 20, 2, 30)), BT_TARE_STANDS); // next to nothing
    finger other = tared(4, 20, 20, 30);
    other.pdc_peak = 800; // a strong press leaves as much
    assert_int_equal(verdict(other), BT_TARE_STANDS);
    other = tared(4, 20, 20, 30);
    other.base.pdc_q16 = BT_TARE_UNKNOWN;
    assert_int_equal(verdict(other), BT_TARE_STANDS);
    other = tared(4, 20, 20, 30);
    other.change.known = false;
    assert_int_equal(verdict(other), BT_TARE_LOSE);
    other = tared(4, 20, 20, 30);
    for (int i = 4; i < 12; i++) {
        other.smooth.lane[i] = REST - 40; // a touch beside it would press
    }
    assert_int_equal(verdict(other), BT_TARE_LOSE);
}

static void less_pressure_than_at_rest_is_no_touch(void **state)
{
    (void)state;
    for (int way = -30; way <= 30; way += 60) { // pressed skin bulges elsewhere: either may prevail
        assert_int_equal(verdict(tared(5, 0, way, 30)), BT_TARE_LOSE);
        assert_int_equal(verdict(tared(5, 0, way, 5)), BT_TARE_STANDS);
        finger after_press = tared(5, 0, way, 60);
        after_press.pdc_peak = 400;
        assert_int_equal(verdict(after_press), BT_TARE_LOSE);
        after_press.pdc_peak = 1600; // what it left may be
        assert_int_equal(verdict(after_press), BT_TARE_STANDS);
        finger colder = tared(5, 0, way, 30); // pressure may have fallen, but a touch takes away
        colder.colder = true;
        assert_int_equal(verdict(colder), way < 0 ? BT_TARE_LOSE : BT_TARE_STANDS);
    }
}

static void electrodes_without_a_tare_or_a_word_say_nothing(void **state)
{
    (void)state;
    finger one = tared(1, 60, 60, 30);
    assert_int_equal(verdict(one), BT_TARE_UNDO);
    finger silent = one;
    silent.smooth.lane[0] = BT_FULL_SCALE_COUNT + 1;
    assert_int_equal(verdict(silent), BT_TARE_STANDS);
    silent = one;
    silent.base.electrode_q16[0] = BT_TARE_UNKNOWN;
    assert_int_equal(verdict(silent), BT_TARE_STANDS);
    bt_baseline before = one.base;
    before.electrode_q16[0] = BT_TARE_UNKNOWN; // nothing is known of how this tare differs
    bt_inverted_note(&one.change, &before, &one.base);
    assert_false(one.change.known);
    assert_int_equal(one.change.electrode_q3[0], 0);
}

static void undone_is_the_tare_before_as_it_would_have_drifted(void **state)
{
    (void)state;
    finger its = tared(4, 20, 20, 30);
    its.change.pdc_q3 = 8 * 40;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        its.base.electrode_q16[i] += 3 << 16;
    }
    bt_inverted_undo(&its.change, &its.base);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        assert_int_equal(its.base.electrode_q16[i], (REST + 3 - (i < 4 ? 20 : 0)) << 16);
    }
    assert_int_equal(its.base.pdc_q16, (PDC - 40) << 16);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_rounds_in_a_row_must_say_so),
        cmocka_unit_test(each_condition_must_hold),
        cmocka_unit_test(less_pressure_than_at_rest_is_no_touch),
        cmocka_unit_test(electrodes_without_a_tare_or_a_word_say_nothing),
        cmocka_unit_test(undone_is_the_tare_before_as_it_would_have_drifted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
