// When a tare is undone or lost, at the edges of each condition (SPEC.md, Tare).
#include "support.h"

#include "touch/inverted.h"

#define REST 3000
#define PDC  1000

typedef struct {
    bt_tare_change change;
    bt_baseline base;
    bt_lanes smooth;
    int32_t pdc_peak;
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
    return bt_inverted_judge(&its->change, &its->smooth, &its->base, its->pdc_peak);
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

static void pressure_must_be_further_down_than_a_press_leaves_it(void **state)
{
    (void)state;
    assert_int_equal(verdict(tared(4, 20, 20, 12)), BT_TARE_STANDS);
    assert_int_equal(verdict(tared(4, 20, 20, 13)), BT_TARE_UNDO);
    finger its = tared(4, 20, 20, 12 + 10);
    its.pdc_peak = 160; // a 16th of it
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its.smooth.lane[BT_LANE_PDC]--;
    assert_int_equal(verdict(its), BT_TARE_UNDO);
    its.base.pdc_q16 = BT_TARE_UNKNOWN;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
}

static void signals_must_be_the_change_upside_down(void **state)
{
    (void)state;
    assert_int_equal(verdict(tared(3, 10, 10, 15)), BT_TARE_STANDS); // an energy of 300
    assert_int_equal(verdict(tared(4, 10, 10, 15)), BT_TARE_UNDO);
    assert_int_equal(verdict(tared(4, 1, 10, 15)), BT_TARE_UNDO);     // however little it was
    assert_int_equal(verdict(tared(4, 10, -10, 15)), BT_TARE_STANDS); // the right way up
    finger its = tared(4, 20, 20, 15);
    its.change.known = false;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its = tared(4, 20, 20, 15);
    for (int i = 4; i < 8; i++) {
        its.smooth.lane[i] = REST - 19; // as much beside it: nearly 45 degrees
    }
    assert_int_equal(verdict(its), BT_TARE_UNDO);
    for (int i = 4; i < 8; i++) {
        its.smooth.lane[i] = REST - 20;
    }
    assert_int_equal(verdict(its), BT_TARE_STANDS);
}

static void electrodes_without_a_tare_or_a_word_say_nothing(void **state)
{
    (void)state;
    finger its = tared(4, 10, 10, 15);
    its.base.electrode_q16[0] = BT_TARE_UNKNOWN; // three are left
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its = tared(4, 10, 10, 15);
    its.smooth.lane[0] = BT_FULL_SCALE_COUNT + 1;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    bt_baseline before = its.base;
    before.electrode_q16[0] = BT_TARE_UNKNOWN; // nothing is known of how this tare differs
    bt_inverted_note(&its.change, &before, &its.base);
    assert_false(its.change.known);
    assert_int_equal(its.change.electrode_q3[0], 0);
}

// More on electrodes than at rest, with less pressure, is no touch; but what a press left may be.
static void a_tare_without_one_before_it_is_lost(void **state)
{
    (void)state;
    finger its = tared(5, 0, -20, 21); // an energy of 2000
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its.smooth.lane[0]++;
    assert_int_equal(verdict(its), BT_TARE_LOSE);
    its.pdc_peak = 24;
    its.smooth.lane[BT_LANE_PDC] = PDC - 60;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its.pdc_peak = 23;
    assert_int_equal(verdict(its), BT_TARE_LOSE);
    its.pdc_peak = 0;
    its.smooth.lane[BT_LANE_PDC] = PDC - 20;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    assert_int_equal(verdict(tared(5, 0, 21, 30)), BT_TARE_STANDS); // a touch takes away
    finger none = tared(6, 0, -20, 21);
    for (int i = 6; i < 12; i++) {
        none.smooth.lane[i] = REST - 20; // and what takes as much as it gives is none either
    }
    assert_int_equal(verdict(none), BT_TARE_STANDS);
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

static void what_is_lost_bulges_by_more_than_it_is_compressed(void **state)
{
    (void)state;
    finger its = tared(0, 0, 0, 21);
    its.smooth.lane[2] = REST + 40;
    its.smooth.lane[5] = REST - 39;
    assert_int_equal(verdict(its), BT_TARE_LOSE);
    its.smooth.lane[5] = REST - 40;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its = tared(0, 0, 0, 21);
    its.smooth.lane[2] = REST + 44; // with the other an energy of 2000
    its.smooth.lane[5] = REST + 8;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its.smooth.lane[6] = REST + 1;
    assert_int_equal(verdict(its), BT_TARE_LOSE);
    its.pdc_peak = 23;
    its.smooth.lane[BT_LANE_PDC]--; // a 16th of it: one count further down
    assert_int_equal(verdict(its), BT_TARE_LOSE);
    its.pdc_peak = 24;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
    its.pdc_peak = 0;
    its.smooth.lane[BT_LANE_PDC] = PDC - 20;
    assert_int_equal(verdict(its), BT_TARE_STANDS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_rounds_in_a_row_must_say_so),
        cmocka_unit_test(pressure_must_be_further_down_than_a_press_leaves_it),
        cmocka_unit_test(signals_must_be_the_change_upside_down),
        cmocka_unit_test(electrodes_without_a_tare_or_a_word_say_nothing),
        cmocka_unit_test(a_tare_without_one_before_it_is_lost),
        cmocka_unit_test(undone_is_the_tare_before_as_it_would_have_drifted),
        cmocka_unit_test(what_is_lost_bulges_by_more_than_it_is_compressed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
