// A held object is never zeroed: doubt, the host's word, and the way back from a tare that was wrong.
#include "emulated_finger.h"

#include "solve/flags.h"

// Squeezed, then let down to a light hold; neither size nor pattern tells it from rest.
static emulated_finger light_hold(double load, double pdc_load)
{
    emulated_finger finger = touched_finger(400, 300);
    run_seconds(&finger, 2);
    load_by(&finger, load, pdc_load);
    (void)run_until(&finger, BT_TARE_STATE_DOUBT, 80);
    return finger;
}

// ---- doubt -------------------------------------------------------------------------------------

TEST(a_light_hold_is_in_doubt_and_keeps_its_force_for_an_hour)
{
    emulated_finger finger = light_hold(40, 30);
    bt_baseline before = finger.tare.base;
    run_seconds(&finger, 3600);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_DOUBT);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
    load_by(&finger, 0, -5);
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 100), 10, 60);
    assert_true(tare_error(&finger) < 0.01);
}

TEST(the_next_contact_is_seen_after_any_number_of_doubtful_ones)
{
    emulated_finger finger = light_hold(40, 30);
    bt_baseline before = finger.tare.base;
    for (int press = 0; press < 100; press++) {
        load_by(&finger, 300, 250);
        assert_in_range(run_until(&finger, BT_TARE_STATE_CONTACT, 10), 1, 6);
        run_seconds(&finger, 1);
        load_by(&finger, 40, 30 + press / 3); // it creeps up
        (void)run_until(&finger, BT_TARE_STATE_DOUBT, 80);
        assert_memory_equal(&finger.tare.base, &before, sizeof before);
    }
}

TEST(pressure_that_returns_from_its_undershoot_is_no_contact)
{
    emulated_finger finger = light_hold(100, -9); // the electrodes keep it in doubt
    finger.pdc_load = 3;
    run_seconds(&finger, 10);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_DOUBT);
}

// A press from rest fires in three rounds; the second of them is the first that tells no more.
TEST(a_touch_right_after_a_doubt_is_one)
{
    emulated_finger finger = light_hold(40, 30);
    for (int round = 1; round <= 3; round++) {
        bt_round frame = next_frame(&finger);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            frame.electrode[i] = (uint16_t)(frame.electrode[i] + 15); // not far: nothing is held back
        }
        assert_int_equal(feed(&finger, &frame) >= 0, round == 1);
        assert_int_equal(finger.tare.state, round < 3 ? BT_TARE_STATE_DOUBT : BT_TARE_STATE_CONTACT);
    }
}

// ---- shifts ------------------------------------------------------------------------------------

TEST(pressure_alone_is_no_touch_after_two_seconds)
{
    for (int step_count = 8; step_count <= 20; step_count += 4) {
        emulated_finger finger = resting_finger();
        finger.pdc_sigma = 1;
        finger.sigma = 5;
        finger.pdc_load = step_count;
        (void)run_until(&finger, BT_TARE_STATE_CONTACT, 6);
        (void)run_until(&finger, BT_TARE_STATE_REST, 195);
        assert_int_equal(finger.tare.reason, BT_TARE_REASON_SHIFT);
    }
}

TEST(what_all_electrodes_share_is_no_touch)
{
    for (int pdc = 0; pdc <= 5; pdc += 5) {
        emulated_finger finger = resting_finger();
        for (int k = 0; k < 500; k++) {
            bt_round round = next_frame(&finger);
            for (int i = 0; i < BT_ELECTRODES; i++) {
                round.electrode[i] = (uint16_t)(round.electrode[i] + 20);
            }
            round.pdc = (uint16_t)(round.pdc + pdc);
            (void)feed(&finger, &round);
        }
        assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
        assert_true(fabs(tare_error(&finger) - 20) < 0.01);
    }
}

TEST(a_pattern_is_kept_where_the_pressure_is_shifted)
{
    emulated_finger finger = touched_finger(10, 20); // 100 count^2
    (void)run_until(&finger, BT_TARE_STATE_REST, 200);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_SHIFT);
    assert_int_equal(finger.tare.base.pdc_q16 >> 16, PDC_REST + 20);
    assert_true(share_kept(&finger, 10) > 0.3); // the mean is gone with the shift
    double mean = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        mean += rest_count(&finger, i) + 10 * load_shape(i) - finger.tare.base.electrode_q16[i] / 65536.0;
    }
    assert_true(fabs(mean / BT_ELECTRODES) < 0.5); // of 2 counts
}

TEST(a_press_that_the_pressure_does_not_see_is_not_judged_by_it)
{
    for (int alive = 0; alive <= 1; alive++) { // the channel is dead from the start, or dies after a press
        emulated_finger finger = touched_finger(400, alive ? 300 : 0);
        run_seconds(&finger, 3);
        finger.load = finger.pdc_load = 0;
        (void)run_until(&finger, BT_TARE_STATE_REST, 100);
        finger.load = 800;
        run_seconds(&finger, alive ? 0.3 : 3);
        bt_baseline before = finger.tare.base;
        finger.load = 60;
        run_seconds(&finger, 60);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_DOUBT);
        assert_memory_equal(&finger.tare.base, &before, sizeof before);
    }
}

// ---- the host's word ---------------------------------------------------------------------------

TEST(while_held_nothing_is_tared_down_to_nothing)
{
    emulated_finger finger = touched_finger(400, 300);
    run_seconds(&finger, 2);
    bt_tare_hold(&finger.tare);
    assert_true(finger.tare.changed);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_HOST_HOLD);
    bt_baseline before = finger.tare.base;
    load_by(&finger, 3, 1);
    run_seconds(&finger, 3600);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
    bt_tare_release(&finger.tare);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_HOST_RELEASE);
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 100), 1, 50);
}

// Shear too light to be a touch, but the host reports a hold: only the drift shared by all electrodes is
// followed.
TEST(what_is_held_and_not_seen_is_kept)
{
    emulated_finger finger = resting_finger();
    bt_tare_hold(&finger.tare);
    const bt_baseline before = finger.tare.base;
    for (int k = 0; k < 60 * FRAMES_PER_S; k++) {
        bt_round frame = next_frame(&finger);
        for (int i = 0; i < BT_ELECTRODES - 1; i++) {
            frame.electrode[i] = (uint16_t)(frame.electrode[i] + (i % 2 ? 7 : -7)); // 882 count^2
        }
        (void)feed(&finger, &frame);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
}

TEST(release_settles_what_was_in_doubt)
{
    emulated_finger finger = light_hold(60, 30);
    bt_tare_release(&finger.tare);
    assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 100), 1, 20);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_RESIDUE);
}

// The word stands for the load left then. A hand that squeezes on without a release holds.
TEST(what_is_squeezed_anew_after_a_release_is_held)
{
    for (int again = 0; again <= 1; again++) {
        emulated_finger finger = touched_finger(400, 300);
        run_seconds(&finger, 2);
        load_by(&finger, 200, 120);
        run_seconds(&finger, 0.5);
        bt_tare_release(&finger.tare);
        run_seconds(&finger, 0.5);
        load_by(&finger, again ? 350 : 200, again ? 250 : 120);
        run_seconds(&finger, 2);
        load_by(&finger, 80, 60);
        run_seconds(&finger, 5);
        assert_int_equal(finger.tare.state, again ? BT_TARE_STATE_DOUBT : BT_TARE_STATE_REST);
        assert_true(again == (tare_error(&finger) < 1));
    }
}

TEST(a_lapsed_hold_is_judged_by_its_signals)
{
    emulated_finger finger = touched_finger(400, 300);
    bt_tare_hold(&finger.tare);
    run_seconds(&finger, 2);
    load_by(&finger, 60, 30);
    run_seconds(&finger, 10);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    bt_tare_lapse(&finger.tare);
    (void)run_until(&finger, BT_TARE_STATE_DOUBT, 20);
    run_seconds(&finger, 10);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_DOUBT);
}

// A TARE tells one reason, with the round after it: whenever the word comes, a verdict may not replace it.
TEST(the_hosts_word_is_told_before_what_follows_from_it)
{
    for (int rounds = 0; rounds < BT_SWEEP_ROUNDS; rounds++) {
        emulated_finger finger = touched_finger(400, 300);
        bt_tare_hold(&finger.tare);
        load_by(&finger, 0, 0);
        run_seconds(&finger, 2 + rounds * 0.01);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
        bt_tare_release(&finger.tare);
        run_seconds(&finger, 0.01);
        assert_int_equal(finger.tare.reason, BT_TARE_REASON_HOST_RELEASE);
        assert_in_range(run_until(&finger, BT_TARE_STATE_REST, 100), 1, 20);
    }
}

TEST(a_held_finger_takes_a_first_tare_that_is_unsure_whatever_the_host_says)
{
    emulated_finger finger = new_finger();
    bt_tare_hold(&finger.tare);
    (void)run_until(&finger, BT_TARE_STATE_REST, 100);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_START);
    assert_true(finger.tare.unsure && finger.tare.held);
    bt_tare_release(&finger.tare);
    assert_true(!finger.tare.unsure && finger.tare.likely); // nothing but a release makes it sure
}

// A hand acts on these words: with them a frame's force is another.
TEST(a_frame_says_what_is_known_of_its_tare)
{
    const uint32_t all = BT_FRAME_FLAG_CONTACT | BT_FRAME_FLAG_DOUBT | BT_FRAME_FLAG_HELD
                         | BT_FRAME_FLAG_TARE_UNSURE | BT_FRAME_FLAG_PDC_FLAT | BT_FRAME_FLAG_UNTARED;
    emulated_finger finger = light_hold(40, 30);
    bt_tare *tare = &finger.tare;
    const bt_round round = next_frame(&finger);
    tare->unsure = false;
    assert_int_equal(bt_channel_flags(&round, tare) & all, BT_FRAME_FLAG_DOUBT);
    tare->unsure = true;
    assert_int_equal(bt_channel_flags(&round, tare) & all, BT_FRAME_FLAG_DOUBT | BT_FRAME_FLAG_TARE_UNSURE);
    bt_tare_hold(tare);
    tare->unsure = false;
    assert_int_equal(bt_channel_flags(&round, tare) & all, BT_FRAME_FLAG_CONTACT | BT_FRAME_FLAG_HELD);
    tare->held = false;
    tare->witness.flat = true;
    assert_int_equal(bt_channel_flags(&round, tare) & all, BT_FRAME_FLAG_CONTACT | BT_FRAME_FLAG_PDC_FLAT);
    tare->tared = tare->witness.flat = false;
    assert_true(bt_channel_flags(&round, tare) & BT_FRAME_FLAG_UNTARED);
}

// ---- a tare that was wrong ---------------------------------------------------------------------

TEST(a_tare_taken_of_a_hold_is_lost_when_it_ends)
{
    for (int frames = 5; frames <= 200; frames += 39) { // let go within so many
        emulated_finger finger = touched_finger(400, 300);
        run_seconds(&finger, 2);
        load_by(&finger, 200, 150);
        run_seconds(&finger, 1);
        assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_OK);
        run_seconds(&finger, 3);
        int inverted = 0;
        for (int k = 1; k <= frames + 100; k++) {
            double left = k < frames ? 1 - (double)k / frames : 0;
            load_by(&finger, 200 * left, 150 * left - 5);
            step(&finger);
            double kept = share_kept(&finger, 1) - 1; // counts that the tare adds to any load
            inverted += finger.tare.tared && finger.load + kept < -40;
        }
        assert_true(inverted <= 10);
        assert_true(tare_error(&finger) < 20); // count^2 below 400 are calm, and followed
    }
}

// A host that got no reply repeats the TARE, and the tare that pressure contradicted must not be the witness.
TEST(a_tare_taken_of_a_hold_is_as_unsure_when_it_is_taken_twice)
{
    emulated_finger finger = touched_finger(400, 300);
    for (int times = 0; times < 3; times++) {
        run_seconds(&finger, 2);
        assert_int_equal(bt_tare_now(&finger.tare), BT_ERROR_OK);
        assert_true(finger.tare.unsure);
    }
    bt_tare_release(&finger.tare);
    assert_true(!finger.tare.unsure && finger.tare.likely);
}

TEST(a_first_tare_taken_of_a_hold_is_lost_when_it_ends)
{
    emulated_finger finger = new_finger();
    load_by(&finger, 400, 300);
    run_seconds(&finger, 5);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    load_by(&finger, 0, 0);
    run_frames(&finger, 10);
    assert_false(finger.tare.tared);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_INVERTED);
    (void)run_until(&finger, BT_TARE_STATE_REST, 40);
    assert_true(tare_error(&finger) < 0.01);
}

// Pressure that a press leaves missing counts from the level before the press, for the trigger too.
TEST(pressure_that_comes_back_beyond_its_rest_is_no_contact)
{
    emulated_finger finger = touched_finger(300, 640);
    run_seconds(&finger, 1);
    load_by(&finger, 0, -6);
    (void)run_until(&finger, BT_TARE_STATE_REST, 300);
    assert_int_equal(finger.tare.base.pdc_q16, PDC_REST << 16);
    finger.pdc_load = 5;
    for (int k = 0; k < 20; k++) {
        step(&finger);
        assert_int_equal(finger.tare.hits, 0);
    }
}
