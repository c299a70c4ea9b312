// The tare machine against whole courses of signals: slow loads, noise, drift, hours.
// The bounds are those of SPEC.md, Tare; host/docs/develop/constants.md has what they rest on.
#include "emulated_finger.h"

#define HELD_N            5.0
#define COUNTS_PER_N      80.0 // 5 N is 400 counts over all electrodes: a sum of squares of 162,730
#define PDC_PER_N         100.0
#define SLEW_COUNTS_PER_S 0.5005 // 328 / 65536 a frame

typedef struct {
    double kept;      // of the signal at 5 N, by the tare frozen at detection
    double kept_held; // by the tare two seconds after 5 N are reached
    double seconds;   // from the load's begin to detection
} ramp_outcome;

static ramp_outcome load_slowly(double n_per_s, bool with_pdc, double sigma, uint64_t seed)
{
    emulated_finger finger;
    ramp_outcome outcome = {0, 0, -1};
    finger_init(&finger);
    finger.seed = seed;
    finger.has_pdc = with_pdc;
    finger.sigma = sigma;
    finger.pdc_sigma = 1;
    run_seconds(&finger, 10);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    int frames = (int)(HELD_N / n_per_s * FRAMES_PER_S) + 2 * FRAMES_PER_S;
    for (int k = 1; k <= frames; k++) {
        double force = n_per_s * k / FRAMES_PER_S;
        force = force < HELD_N ? force : HELD_N;
        finger.load = force * COUNTS_PER_N;
        finger.pdc_load = force * PDC_PER_N;
        step(&finger);
        if (finger.tare.state == BT_TARE_STATE_CONTACT && outcome.seconds < 0) {
            outcome.seconds = (double)k / FRAMES_PER_S;
            outcome.kept = share_kept(&finger, HELD_N * COUNTS_PER_N);
            assert_int_equal(finger.tare.reason, BT_TARE_REASON_ROLL_BACK);
        }
    }
    assert_true(outcome.seconds > 0);
    outcome.kept_held = share_kept(&finger, HELD_N * COUNTS_PER_N);
    return outcome;
}

TEST(slow_loads_keep_their_signal_at_detection_without_pressure)
{
    static const double rates[] = {0.1, 0.2, 0.5, 1, 2, 5, 20};
    for (size_t r = 0; r < sizeof rates / sizeof *rates; r++) {
        double worst = 2, longest = 0;
        for (uint64_t seed = 1; seed <= 5; seed++) {
            ramp_outcome outcome = load_slowly(rates[r], false, 1.5, seed);
            // What may be lost: the slew for as long as nothing was seen, less the second of the
            // roll-back, on 19 electrodes; and the noise of a mean of eight frames.
            double at_risk = outcome.seconds > 1 ? outcome.seconds - 1 : 0;
            double lost = (1 - outcome.kept) * HELD_N * COUNTS_PER_N;
            assert_true(lost <= SLEW_COUNTS_PER_S * sqrt(BT_ELECTRODES) * at_risk + 3);
            worst = fmin(worst, fmin(outcome.kept, outcome.kept_held)); // at its peak nothing is released
            longest = outcome.seconds > longest ? outcome.seconds : longest;
        }
        print_message("no PDC, %5.2f N/s: kept %.4f, seen after %.2f s\n", rates[r], worst, longest);
        assert_true(worst >= 0.98);
    }
}

TEST(pressure_saves_even_the_slowest_loads)
{
    static const double rates[] = {0.02, 0.1, 0.5, 2, 20};
    for (size_t r = 0; r < sizeof rates / sizeof *rates; r++) {
        double worst = 2, longest = 0;
        for (uint64_t seed = 1; seed <= 5; seed++) {
            ramp_outcome outcome = load_slowly(rates[r], true, 1.5, seed);
            worst = outcome.kept_held < worst ? outcome.kept_held : worst;
            longest = outcome.seconds > longest ? outcome.seconds : longest;
        }
        print_message("with PDC, %5.2f N/s: kept %.4f, seen after %.2f s\n", rates[r], worst, longest);
        assert_true(worst >= 0.99);
    }
}

TEST(a_load_slower_than_the_slew_is_taken_for_drift)
{
    // The stated limit of the machine, so that nobody is surprised: 0.02 N/s without pressure.
    emulated_finger finger;
    finger_init(&finger);
    finger.has_pdc = false;
    run_seconds(&finger, 10);
    for (int k = 0; k < 3000; k++) {
        finger.load += 0.4 / FRAMES_PER_S;
        step(&finger);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_true(share_kept(&finger, finger.load) < 0.2);
}

TEST(ten_minutes_of_rest_have_no_contact)
{
    // A new sensor; a worn one with glitches, drifting by 15 counts/min.
    static const double drifts_per_s[] = {0, -15 / 60.0, 15 / 60.0};
    for (int k = 0; k < 3; k++) {
        emulated_finger finger;
        double worst = 0;
        finger_init(&finger);
        finger.sigma = k == 0 ? 1.5 : 5;
        finger.pdc_sigma = 1;
        finger.glitch_chance = k == 0 ? 0 : 0.005;
        finger.drift_per_s = drifts_per_s[k];
        run_seconds(&finger, 10);
        for (int frame = 0; frame < 600 * FRAMES_PER_S; frame++) {
            step(&finger);
            assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
            worst = fmax(worst, tare_error(&finger));
        }
        print_message("sigma %.1f: tare off by at most %.2f counts, noise %u count^2\n", finger.sigma, worst,
                      (unsigned)finger.tare.noise.count2);
        // A mean of eight frames is followed at half a count a second at most.
        assert_true(worst < 3 * finger.sigma);
        assert_int_equal(finger.tare.reason, BT_TARE_REASON_START);
    }
}

TEST(the_threshold_rises_with_measured_noise_and_only_with_it)
{
    emulated_finger finger;
    finger_init(&finger);
    finger.sigma = 1.5;
    run_seconds(&finger, 5);
    assert_int_equal(finger.tare.threshold_count2, SETTING_COUNT2);
    // Sigma 7: over 19 electrodes 931 count^2.
    finger_init(&finger);
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
    finger_init(&finger);
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
        emulated_finger finger;
        finger_init(&finger);
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

TEST(a_press_after_hours_of_drift_is_seen_whole)
{
    emulated_finger finger;
    finger_init(&finger);
    finger.drift_per_s = -0.1; // 720 counts in two hours
    run_seconds(&finger, 2 * 3600);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    assert_int_equal(finger.tare.age_rounds, 2 * 3600 * FRAMES_PER_S - 2 * BT_SWEEP_ROUNDS);
    assert_true(tare_error(&finger) < 1);
    finger.load = 400;
    (void)run_until(&finger, BT_TARE_STATE_CONTACT, 10);
    assert_true(share_kept(&finger, 400) > 0.995);
}

TEST(counters_near_their_ends_do_not_wrap_into_nonsense)
{
    emulated_finger finger;
    finger_init(&finger);
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

int main(void)
{
    return run_all(NULL, NULL);
}
