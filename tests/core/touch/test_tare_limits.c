// Where the tare machine's thresholds and counters end; whole courses of slow loads, noise, drift and hours:
// tests/stability/test_front_end.py.
#include "emulated_finger.h"

TEST(a_load_slower_than_the_slew_is_taken_for_drift)
{
    // The stated limit of the machine: 0.02 N/s without pressure.
    emulated_finger finger = new_finger();
    finger.has_pdc = false;
    run_seconds(&finger, 10);
    for (int k = 0; k < 3000; k++) {
        finger.load += 0.4 / FRAMES_PER_S;
        step(&finger);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_true(share_kept(&finger, finger.load) < 0.2);
}

TEST(the_threshold_rises_with_measured_noise_and_only_with_it)
{
    emulated_finger finger = new_finger();
    finger.sigma = 1.5;
    run_seconds(&finger, 5);
    assert_int_equal(finger.tare.threshold_count2, SETTING_COUNT2);
    // Sigma 7: over 19 electrodes 931 count^2.
    finger = new_finger();
    finger.sigma = 7;
    run_seconds(&finger, 20);
    assert_in_range(finger.tare.noise.count2, 800, 1000);
    uint32_t noise_count2 = finger.tare.noise.count2;
    step(&finger);
    assert_int_equal(finger.tare.threshold_count2, 3 * noise_count2);
    finger.settings.contact_energy_count2 = 100000;
    run_frames(&finger, BT_SWEEP_ROUNDS);
    assert_int_equal(finger.tare.threshold_count2, 100000);
    // A load that creeps up below the threshold is no noise.
    finger = new_finger();
    finger.has_pdc = false;
    run_seconds(&finger, 5);
    uint32_t before = finger.tare.noise.count2;
    for (int k = 0; k < 100; k++) {
        finger.load += 0.25;
        step(&finger);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_true(finger.tare.noise.count2 <= before + 25);
}

TEST(a_growing_vibration_does_not_raise_the_threshold_out_of_reach)
{
    // Each swing passes for noise and lifts the threshold over the next: 10 counts/s of growth.
    for (int half = 2; half <= 6; half++) {
        emulated_finger finger = new_finger();
        finger.has_pdc = false;
        finger.sigma = 1.5;
        run_seconds(&finger, 10);
        int k = 0;
        while (finger.tare.state == BT_TARE_STATE_REST) {
            if (++k == 3000) {
                fail_msg("a swing of +-300 counts (90,000 count^2) is not seen; the threshold is %u",
                         (unsigned)finger.tare.threshold_count2);
            }
            finger.load = 0.1 * k * (k / half % 2 ? 1 : -1);
            step(&finger);
        }
    }
}

TEST(counters_near_their_ends_do_not_wrap_into_nonsense)
{
    emulated_finger finger = new_finger();
    finger.has_pdc = false;
    run_seconds(&finger, 5);
    finger.load = 400;
    (void)run_until(&finger, BT_TARE_STATE_CONTACT, 10);
    // 497 days in contact: the forgiven residue is still that of a minute of drift, 10,275 count^2.
    finger.tare.contact_rounds = UINT32_MAX - 200;
    finger.tare.age_rounds = UINT32_MAX - 200;
    run_frames(&finger, 400);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    finger.load = 0;
    (void)run_until(&finger, BT_TARE_STATE_REST, 30);
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_RELEASE);
}
