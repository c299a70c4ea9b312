// The tare machine's way through rest and contact, rule by rule (numerics 1.4, SPEC.md Tare), on
// exact counts.
#include "emulated_finger.h"

// ---- start -------------------------------------------------------------------------------------

static void the_first_tare_needs_two_still_sweeps(void **state)
{
    (void)state;
    emulated_finger finger;
    finger_init(&finger);
    run_frames(&finger, 2 * BT_SWEEP_ROUNDS - 1);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_INIT);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_NONE);
    step(&finger);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_START);
    assert_true(finger.tare.changed);
    assert_true(tare_error(&finger) == 0);
    assert_int_equal(finger.tare.base.pdc_q16, PDC_REST << 16);
    step(&finger);
    assert_false(finger.tare.changed);
}

static void nothing_is_tared_while_one_electrode_moves(void **state)
{
    (void)state;
    emulated_finger finger;
    finger_init(&finger);
    for (int k = 0; k < 1000; k++) {
        bt_round frame = frame_without(&finger, 13, 1, (uint16_t)(2000 + k % 50 * 10));
        (void)feed(&finger, &frame);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_INIT);
    }
    // The sweep under way, one that still holds some of its end, and two still ones.
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 32), 16, 32);
}

static void a_missing_word_does_not_look_like_motion(void **state)
{
    (void)state;
    emulated_finger finger;
    finger_init(&finger);
    step(&finger);
    for (int k = 0; k < 3000; k++) {
        bt_round frame = frame_without(&finger, k * 7 % 18, 1 + k % 2, BT_INVALID_COUNT);
        if (k % 3 == 0) {
            frame.pdc = BT_INVALID_COUNT;
        }
        (void)feed(&finger, &frame);
        assert_int_equal(finger.tare.state, k < 14 ? BT_TARE_STATE_INIT : BT_TARE_STATE_REST);
    }
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_START);
    assert_true(tare_error(&finger) < 0.01);
    assert_int_equal(finger.tare.noise.count2, 0);
}

static void an_electrode_that_was_never_read_makes_no_contact_when_it_comes(void **state)
{
    (void)state;
    emulated_finger finger;
    finger_init(&finger);
    for (int k = 0; k < 200; k++) { // two missing electrodes are no fault
        bt_round frame = frame_without(&finger, 4, 2, BT_INVALID_COUNT);
        (void)feed(&finger, &frame);
    }
    run_seconds(&finger, 2);
    // Nothing ever touched this finger, so no signal may be left, whether by a tare or by none.
    assert_int_not_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_true(finger.tare.state == BT_TARE_STATE_INIT || tare_error(&finger) < 1);
}

static void a_stored_tare_before_the_first_word_makes_no_contact(void **state)
{
    (void)state;
    emulated_finger finger;
    bt_baseline base = {.pdc_q16 = PDC_REST << 16};
    finger_init(&finger);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = (uint32_t)lround(rest_count(&finger, i)) << 16;
    }
    assert_int_equal(bt_tare_set(&finger.tare, &base), BT_ERROR_OK);
    for (int k = 0; k < 10; k++) {
        bt_round frame = frame_without(&finger, 4, 1, BT_INVALID_COUNT);
        (void)feed(&finger, &frame);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    }
}

static void a_restored_tare_carries_a_grip_over_a_reset(void **state)
{
    (void)state;
    for (int held = 0; held < 2; held++) {
        emulated_finger before, finger;
        bt_tare_kept kept;
        finger_init(&before);
        run_seconds(&before, 10);
        before.tare.held = held;
        before.tare.unsure = !held;
        bt_tare_keep(&before.tare, &kept);
        finger_init(&finger);
        bt_tare_restore(&finger.tare, &kept);
        finger.load = 300;
        finger.pdc_load = 200;
        assert_true(run_until(&finger, BT_TARE_STATE_CONTACT, 20) <= 5);
        run_seconds(&finger, 60);
        assert_true(finger.tare.state == BT_TARE_STATE_CONTACT && finger.tare.held == held);
        assert_true(finger.tare.unsure == !held); // what was in doubt still is
        assert_true(fabs(share_kept(&finger, 300) - 1) < 0.02);
    }
}

static void one_missing_pressure_word_does_not_forget_the_pressure_at_rest(void **state)
{
    (void)state;
    emulated_finger finger;
    finger_init(&finger);
    run_frames(&finger, 2 * BT_SWEEP_ROUNDS - 1);
    bt_round frame = next_frame(&finger);
    frame.pdc = BT_INVALID_COUNT; // in the very frame that tares
    (void)feed(&finger, &frame);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_int_equal(finger.tare.base.pdc_q16, PDC_REST << 16);
}

// ---- contact -----------------------------------------------------------------------------------

static void three_frames_over_the_threshold_make_a_contact_and_two_do_not(void **state)
{
    (void)state;
    emulated_finger finger = resting_finger();
    for (int burst = 1; burst <= 2; burst++) {
        for (int gap = 0; gap < 50; gap++) {
            finger.load = 400;
            run_frames(&finger, burst);
            finger.load = 0;
            run_frames(&finger, 12);
            assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
        }
    }
    finger.load =
        600; // every electrode moves far: the trigger sees the second frame, then three of them count
    assert_int_equal(run_until(&finger, BT_TARE_STATE_CONTACT, 10), 4);
}

static void pressure_alone_makes_a_contact(void **state)
{
    (void)state;
    emulated_finger finger = resting_finger();
    finger.pdc_load = 6;
    run_frames(&finger, 100);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    finger.pdc_load = 8;
    assert_int_equal(run_until(&finger, BT_TARE_STATE_CONTACT, 5), 3);
    finger = resting_finger();
    finger.pdc_load = -50; // an undershoot is no contact
    run_frames(&finger, 100);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
}

static void energy_at_the_threshold_is_no_contact_and_over_it_is(void **state)
{
    (void)state;
    for (int over = 0; over <= 1; over++) {
        emulated_finger finger = resting_finger();
        for (int k = 0; k < 6; k++) {
            bt_round frame = next_frame(&finger);
            frame.electrode[3] = (uint16_t)(frame.electrode[3] - 30); // 900 + 100
            frame.electrode[7] = (uint16_t)(frame.electrode[7] - 10 - over);
            (void)feed(&finger, &frame);
        }
        assert_int_equal(finger.tare.state, over ? BT_TARE_STATE_CONTACT : BT_TARE_STATE_REST);
    }
}

static void the_roll_back_takes_the_tare_of_at_least_a_second_before(void **state)
{
    (void)state;
    for (int phase = 0; phase < 24; phase++) {
        emulated_finger finger;
        finger_init(&finger);
        finger.has_pdc = false;   // or what drift has made since would be added
        finger.drift_per_s = 0.4; // the tare follows, so each of its values has a time
        run_frames(&finger, 500 + phase);
        int frames = 0;
        finger.load = 300;
        while (finger.tare.state != BT_TARE_STATE_CONTACT) {
            step(&finger);
            assert_true(++frames < 10);
        }
        // The same finger once more, recorded: which of its tares came back?
        emulated_finger twin;
        finger_init(&twin);
        twin.has_pdc = false;
        twin.drift_per_s = 0.4;
        int age = -1;
        for (int k = 1; k <= 500 + phase; k++) {
            step(&twin);
            if (memcmp(&twin.tare.base, &finger.tare.base, sizeof twin.tare.base) == 0) {
                age = 500 + phase + frames - k;
            }
        }
        // Five snapshots of 240 ms back from the latest, which is up to 240 ms old, and three rounds of hits.
        assert_in_range(age, 120, 147);
        assert_int_equal(finger.tare.reason, BT_TARE_REASON_ROLL_BACK);
    }
}

static void without_pressure_the_tare_is_frozen_in_contact(void **state)
{
    (void)state;
    emulated_finger finger = touched_finger(400, 100);
    finger.has_pdc = false;
    bt_baseline before = finger.tare.base;
    finger.drift_per_s = 0.1;
    run_seconds(&finger, 100);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
    assert_true(finger.tare.contact_rounds >= 10000);
}

static void drift_of_all_electrodes_is_followed_in_contact_while_the_pressure_is_level(void **state)
{
    (void)state;
    emulated_finger finger = touched_finger(400, 100);
    finger.drift_per_s = 0.25; // 15 counts a minute
    double begun = tare_error(&finger);
    run_seconds(&finger, 600);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    // Five seconds until the pressure counts as level, and what the slew is behind: of 150 counts.
    assert_true(tare_error(&finger) < begun + 3);
    assert_true(fabs(share_kept(&finger, 400) - 1) < 0.05);
}

// ---- release -----------------------------------------------------------------------------------

static void a_clean_release_is_tared_after_two_calm_sweeps(void **state)
{
    (void)state;
    emulated_finger finger = touched_finger(400, 100);
    run_seconds(&finger, 3);
    finger.load = 0;
    finger.pdc_load = -5; // real skin undershoots
    // A sweep whose windows begin after the release and the filter's one round, and one in which nothing
    // moves.
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 40), 16, 34);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_RELEASE);
    assert_true(finger.tare.changed);
    assert_true(tare_error(&finger) < 0.01);
}

static void residue_is_tared_once_the_pressure_is_back_and_nothing_moves(void **state)
{
    (void)state;
    emulated_finger finger = touched_finger(400, 300);
    run_seconds(&finger, 3);
    finger.load = 45; // 2,025 count^2 of 160,000; and a 50th of the pressure
    finger.pdc_load = 6;
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 100), 40, 70);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_RESIDUE);
    assert_true(fabs(share_kept(&finger, 45)) < 0.01);
}

static void more_energy_than_residue_is_a_hold(void **state)
{
    (void)state;
    // With the pressure back; with a pressure that no press of that size leaves; and without one.
    static const int pdc[] = {0, 24, -1};
    for (int k = 0; k < 3; k++) {
        emulated_finger finger = touched_finger(400, 300);
        run_seconds(&finger, 3);
        bt_baseline before = finger.tare.base;
        finger.load = 100; // 10,000 count^2
        finger.has_pdc = pdc[k] >= 0;
        finger.pdc_load = pdc[k];
        run_seconds(&finger, 40);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_DOUBT);
        assert_memory_equal(&finger.tare.base, &before, sizeof before);
    }
}

static void residue_that_moves_is_a_hold(void **state)
{
    (void)state;
    emulated_finger finger = touched_finger(400, 0);
    for (int k = 0; k < 2000; k++) { // a rub: 45 +- 30 counts at 4 Hz
        finger.load = 45 + 30 * sin(2 * 3.14159265 * 4 * k / FRAMES_PER_S);
        step(&finger);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    }
}

static void pressure_keeps_a_held_object_from_being_tared(void **state)
{
    (void)state;
    static const double loads[] = {30, 40, 60}; // 900 to 3,600 count^2; what is less is pressure alone
    for (int k = 0; k < 3; k++) {
        emulated_finger finger = touched_finger(loads[k], 9);
        bt_baseline before = finger.tare.base;
        finger.pdc_load = 5;
        run_seconds(&finger, 300);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
        assert_memory_equal(&finger.tare.base, &before, sizeof before);
        finger.load = 0;
        finger.pdc_load = 0;
        assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 200), 1, 120);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_tare_needs_two_still_sweeps),
        cmocka_unit_test(nothing_is_tared_while_one_electrode_moves),
        cmocka_unit_test(a_missing_word_does_not_look_like_motion),
        cmocka_unit_test(an_electrode_that_was_never_read_makes_no_contact_when_it_comes),
        cmocka_unit_test(a_stored_tare_before_the_first_word_makes_no_contact),
        cmocka_unit_test(a_restored_tare_carries_a_grip_over_a_reset),
        cmocka_unit_test(one_missing_pressure_word_does_not_forget_the_pressure_at_rest),
        cmocka_unit_test(three_frames_over_the_threshold_make_a_contact_and_two_do_not),
        cmocka_unit_test(pressure_alone_makes_a_contact),
        cmocka_unit_test(energy_at_the_threshold_is_no_contact_and_over_it_is),
        cmocka_unit_test(the_roll_back_takes_the_tare_of_at_least_a_second_before),
        cmocka_unit_test(without_pressure_the_tare_is_frozen_in_contact),
        cmocka_unit_test(drift_of_all_electrodes_is_followed_in_contact_while_the_pressure_is_level),
        cmocka_unit_test(a_clean_release_is_tared_after_two_calm_sweeps),
        cmocka_unit_test(residue_is_tared_once_the_pressure_is_back_and_nothing_moves),
        cmocka_unit_test(more_energy_than_residue_is_a_hold),
        cmocka_unit_test(residue_that_moves_is_a_hold),
        cmocka_unit_test(pressure_keeps_a_held_object_from_being_tared),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
