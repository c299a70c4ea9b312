// The tare machine's way through rest and contact, rule by rule (SPEC.md, Tare), on
// exact counts.
#include "emulated_finger.h"

// ---- start -------------------------------------------------------------------------------------

TEST(the_first_tare_needs_two_still_sweeps)
{
    emulated_finger finger = new_finger();
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

TEST(nothing_is_tared_while_one_electrode_moves)
{
    emulated_finger finger = new_finger();
    for (int k = 0; k < 1000; k++) {
        feed_without(&finger, 13, 1, (uint16_t)(2000 + k % 50 * 10));
        assert_int_equal(finger.tare.state, BT_TARE_STATE_INIT);
    }
    // The sweep under way, one that still holds some of the release, and two still ones.
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 32), 16, 32);
}

TEST(a_restored_tare_carries_a_grip_over_a_reset)
{
    for (int held = 0; held < 2; held++) {
        emulated_finger before = new_finger(), finger = new_finger();
        bt_tare_kept kept;
        run_seconds(&before, 10);
        before.tare.held = held;
        before.tare.unsure = !held;
        bt_tare_keep(&before.tare, &kept);
        bt_tare_restore(&finger.tare, &kept);
        load_by(&finger, 300, 200);
        assert_true(run_until(&finger, BT_TARE_STATE_CONTACT, 20) <= 5);
        run_seconds(&finger, 60);
        assert_true(finger.tare.state == BT_TARE_STATE_CONTACT && finger.tare.held == held);
        assert_true(finger.tare.unsure == !held); // the doubt remains
        assert_true(fabs(share_kept(&finger, 300) - 1) < 0.02);
    }
}

TEST(one_missing_pressure_word_does_not_forget_the_pressure_at_rest)
{
    emulated_finger finger = new_finger();
    run_frames(&finger, 2 * BT_SWEEP_ROUNDS - 1);
    bt_round frame = next_frame(&finger);
    frame.pdc = BT_INVALID_COUNT; // in the very frame that tares
    (void)feed(&finger, &frame);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_int_equal(finger.tare.base.pdc_q16, PDC_REST << 16);
}

// ---- contact -----------------------------------------------------------------------------------

TEST(three_frames_over_the_threshold_make_a_contact_and_two_do_not)
{
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

TEST(pressure_alone_makes_a_contact)
{
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

TEST(without_pressure_the_tare_is_frozen_in_contact)
{
    emulated_finger finger = touched_finger(400, 100);
    finger.has_pdc = false;
    bt_baseline before = finger.tare.base;
    finger.drift_per_s = 0.1;
    run_seconds(&finger, 100);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
    assert_true(finger.tare.contact_rounds >= 10000);
}

// ---- release -----------------------------------------------------------------------------------

TEST(a_clean_release_is_tared_after_two_calm_sweeps)
{
    emulated_finger finger = touched_finger(400, 100);
    run_seconds(&finger, 3);
    load_by(&finger, 0, -5); // real skin undershoots
    // A sweep with windows that begin after the release and the filter's one round, and one without motion.
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 40), 16, 34);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_RELEASE);
    assert_true(finger.tare.changed);
    assert_true(tare_error(&finger) < 0.01);
}

TEST(residue_is_tared_once_the_pressure_is_back_and_nothing_moves)
{
    emulated_finger finger = touched_finger(400, 300);
    run_seconds(&finger, 3);
    finger.load = 45; // 2,025 count^2 of 160,000; and a 50th of the pressure
    finger.pdc_load = 6;
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 100), 40, 70);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_RESIDUE);
    assert_true(fabs(share_kept(&finger, 45)) < 0.01);
}

TEST(more_energy_than_residue_is_a_hold)
{
    // With the pressure back; with a pressure that no press of that size leaves; and without pressure.
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

TEST(residue_that_moves_is_a_hold)
{
    emulated_finger finger = touched_finger(400, 0);
    for (int k = 0; k < 2000; k++) { // a rub: 45 +- 30 counts at 4 Hz
        finger.load = 45 + 30 * sin(2 * 3.14159265 * 4 * k / FRAMES_PER_S);
        step(&finger);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    }
}

TEST(pressure_keeps_a_held_object_from_being_tared)
{
    static const double loads[] = {30, 40, 60}; // 900 to 3,600 count^2; less is pressure alone
    for (int k = 0; k < 3; k++) {
        emulated_finger finger = touched_finger(loads[k], 9);
        bt_baseline before = finger.tare.base;
        finger.pdc_load = 5;
        run_seconds(&finger, 300);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
        assert_memory_equal(&finger.tare.base, &before, sizeof before);
        load_by(&finger, 0, 0);
        assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 200), 1, 120);
    }
}
