// The tare machine under faults and host commands.
#include "emulated_finger.h"

// ---- fault -------------------------------------------------------------------------------------

TEST(railed_electrodes_are_never_tared)
{
    static const uint16_t ends[] = {0, 4090, 4095, BT_INVALID_COUNT};
    for (int k = 0; k < 4; k++) {
        emulated_finger finger = new_finger();
        for (int n = 0; n < 500; n++) {
            feed_without(&finger, 6, 3, ends[k]);
            assert_int_equal(finger.tare.state, BT_TARE_STATE_FAULT);
            assert_int_equal(finger.tare.reason, BT_TARE_REASON_NONE);
        }
        assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_RAILED);
        assert_int_equal(bt_tare_set(&finger.tare, &finger.tare.base, 0), BT_ERROR_RAILED);
        step(&finger); // never tared, so it starts over
        assert_int_equal(finger.tare.state, BT_TARE_STATE_INIT);
        assert_int_equal(1 + run_until(&finger, BT_TARE_STATE_REST, 20), 2 * BT_SWEEP_ROUNDS);
        assert_true(tare_error(&finger) == 0);
    }
}

TEST(a_fault_freezes_the_tare_and_leaves_things_as_they_were)
{
    emulated_finger finger = resting_finger();
    bt_baseline before = finger.tare.base;
    for (int k = 0; k < 300; k++) {
        feed_without(&finger, 0, 9, 0);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_FAULT);
    }
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
    step(&finger);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
}

TEST(lost_words_at_rest_are_no_touch)
{
    for (int words = 1; words <= BT_ELECTRODES; words++) {
        emulated_finger finger = resting_finger();
        for (int k = 0; k < 200; k++) {
            bt_round frame =
                k % 7 == 3 ? frame_without(&finger, 0, words, BT_INVALID_COUNT) : next_frame(&finger);
            (void)feed(&finger, &frame);
            assert_int_not_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
            assert_int_equal(finger.tare.reason, BT_TARE_REASON_START);
        }
    }
}

TEST(a_touch_that_began_in_a_fault_is_found_by_its_tare)
{
    emulated_finger finger = resting_finger();
    for (int k = 0; k < 50; k++) {
        feed_without(&finger, 0, 9, BT_INVALID_COUNT);
        finger.load = 10 * k;
    }
    assert_in_range(run_until(&finger, BT_TARE_STATE_CONTACT, 20), 2, 5);
    assert_true(share_kept(&finger, finger.load) > 0.99);
}

TEST(a_first_word_in_a_faulty_round_is_met_once_the_fault_clears)
{
    emulated_finger finger = new_finger();
    finger.has_pdc = false;
    for (int k = 0; k < 50; k++) {
        bt_round frame = frame_without(&finger, 4, 1, BT_INVALID_COUNT);
        (void)feed(&finger, &frame);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    bt_round frame = frame_without(&finger, 8, 3, BT_INVALID_COUNT); // E5 has come, three others are gone
    uint16_t rest = frame.electrode[4];
    frame.electrode[4] = (uint16_t)(rest - 10); // nothing of a faulty round may reach a tare
    (void)feed(&finger, &frame);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_FAULT);
    assert_int_equal(finger.tare.electrode_q4[4], BT_INVALID_COUNT);
    step(&finger);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_int_equal(finger.tare.electrode_q4[4], 16 * rest);
    assert_true(tare_error(&finger) == 0);
}

TEST(a_second_faulty_round_in_a_sweep_starts_the_history_over)
{
    for (int rounds = 1; rounds <= 2; rounds++) {
        emulated_finger finger = resting_finger();
        for (int k = 0; k < rounds; k++) {
            feed_without(&finger, 0, 3, 4095);
        }
        step(&finger);
        assert_int_equal(bt_tare_now(&finger.tare), rounds < 2 ? BT_ERROR_OK : BT_ERROR_NOT_STILL);
    }
}

// ---- host commands -----------------------------------------------------------------------------

TEST(tare_now_is_refused_while_the_signals_move)
{
    emulated_finger finger = resting_finger();
    for (int k = 0; k < 40; k++) {
        finger.load += 30;
        step(&finger);
    }
    bt_tare before = finger.tare;
    assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_NOT_STILL);
    assert_memory_equal(&finger.tare, &before, sizeof before);
    run_frames(&finger, 4 * BT_SWEEP_ROUNDS);
    bt_round away = frame_without(&finger, 5, 1, 2000); // the means are still, the latest counts are not
    bt_tare then = finger.tare;
    (void)feed(&finger, &away);
    (void)feed(&finger, &away);
    assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_NOT_STILL);
    finger.tare = then; // held still: the host's word counts
    assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_OK);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_HOST_NOW);
    assert_true(finger.tare.changed);
    assert_true(fabs(share_kept(&finger, finger.load)) < 0.001);
}

TEST(published_tares_round_half_away_from_zero)
{
    assert_int_equal(bt_tare_q4(0), 0);
    assert_int_equal(bt_tare_q4(2047), 0);
    assert_int_equal(bt_tare_q4(2048), 1);
    assert_int_equal(bt_tare_q4(4095u << 16), 65520);
}

// Skin undershoots after a press, so a light touch soon after may begin below the pressure at rest.
TEST(a_held_load_is_kept_while_the_pressure_undershoots)
{
    for (int below = 0; below <= 5; below++) {
        emulated_finger finger = touched_finger(1500, -below);
        run_seconds(&finger, 30);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
        assert_true(share_kept(&finger, 1500) > 0.99);
    }
}

TEST(an_electrode_that_was_railed_is_never_tared_at_its_end)
{
    static const uint16_t ends[] = {0, 4095};
    for (int k = 0; k < 2; k++) {
        emulated_finger finger = new_finger();
        for (int n = 0; n < 50; n++) {
            feed_without(&finger, 2, 1, ends[k]);
        }
        assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
        assert_int_equal(finger.tare.base.electrode_q16[2], BT_TARE_UNKNOWN);
        run_seconds(&finger, 5);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
        assert_true(tare_error(&finger) < 1e-9);
    }
}

// Eight phases of a sweep: in one the verdict comes right after the release, when the pressure has fallen and
// the means of eight rounds still are those of the press.
TEST(a_sudden_release_never_tares_the_press)
{
    for (int phase = 0; phase < 4 * BT_SWEEP_ROUNDS; phase++) {
        // A press; or one so light that only the pressure sees it (225 count^2): the electrodes may keep to
        // the calm limit, but the pressure only to the quiet one.
        bool light = phase % 2;
        emulated_finger finger = touched_finger(light ? 15 : 400, light ? 31 : 200);
        run_frames(&finger, 200 + phase / 2);
        load_by(&finger, 0, 0);
        (void)run_until(&finger, BT_TARE_STATE_REST, 100);
        assert_true(tare_error(&finger) < (light ? 15 : 1));
        assert_in_range(finger.tare.base.pdc_q16 >> 16, PDC_REST, PDC_REST + (light ? 3 : 0));
    }
}

// The pressure sees light loads long before the electrodes do; one lost word is no reason to think that
// there is none.
TEST(one_lost_pressure_word_does_not_end_a_light_contact)
{
    for (int phase = 0; phase < 2 * BT_SWEEP_ROUNDS; phase++) {
        emulated_finger finger = touched_finger(15, 40); // 225 count^2
        run_frames(&finger, 50 + phase);
        bt_round frame = next_frame(&finger);
        frame.pdc = BT_INVALID_COUNT;
        (void)feed(&finger, &frame);
        run_frames(&finger, 50);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
        assert_int_equal(finger.tare.reason, BT_TARE_REASON_ROLL_BACK);
    }
}

TEST(pressure_that_moves_is_no_reason_to_refuse_tare_now)
{
    emulated_finger finger = resting_finger();
    finger.pdc_load = -50; // no touch
    run_frames(&finger, 3);
    assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_OK);
}

// The pattern of a load upside down, with less pressure than at rest.
TEST(what_the_host_has_set_is_lost_if_it_was_wrong)
{
    emulated_finger finger = resting_finger();
    bt_baseline base = finger.tare.base;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] += (uint32_t)(int32_t)lround(65536 * 100 * load_shape(i));
    }
    base.pdc_q16 += 60 << 16;
    assert_int_equal(bt_tare_set(&finger.tare, &base, 0), BT_ERROR_OK);
    for (int k = 0; k < 10 && finger.tare.reason == BT_TARE_REASON_HOST_SET; k++) {
        step(&finger);
    }
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_INVERTED);
    assert_false(finger.tare.tared);
}

// An electrode or pressure first met at rest goes back with the others, to the first reading.
TEST(an_electrode_and_a_pressure_that_came_late_are_rolled_back_too)
{
    emulated_finger finger = new_finger();
    finger.has_pdc = false;
    for (int k = 0; k < 200; k++) {
        feed_without(&finger, 4, 1, BT_INVALID_COUNT);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    finger.has_pdc = true;
    run_frames(&finger, 2);
    press(&finger, 400, 100);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_ROLL_BACK);
    assert_true(tare_error(&finger) < 1 && finger.tare.base.pdc_q16 == PDC_REST << 16);
}
