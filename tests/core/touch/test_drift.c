// Drift that all electrodes share: followed at rest without a lag, and extrapolated where it cannot be seen.
// The truth is the rest of the emulated finger.
#include "emulated_finger.h"

#define WORST_PER_S 0.25 // 15 counts/min

// Mean error of the tare over the electrodes.
static double shared_error(const emulated_finger *finger)
{
    double error = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        error += rest_count(finger, i) - finger->tare.base.electrode_q16[i] / 65536.0;
    }
    return error / BT_ELECTRODES;
}

static emulated_finger worn_finger(uint64_t seed, double drift_per_s, double rest_s)
{
    emulated_finger finger = new_finger();
    finger.seed = seed;
    finger.sigma = 5;
    finger.pdc_sigma = 1;
    finger.glitch_chance = 0.005;
    finger.drift_per_s = drift_per_s;
    run_seconds(&finger, rest_s);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    return finger;
}

// ---- at rest -----------------------------------------------------------------------------------

TEST(the_tare_of_a_worn_finger_does_not_lag_behind_its_drift)
{
    for (uint64_t seed = 1; seed <= 4; seed++) {
        emulated_finger finger = worn_finger(seed, seed % 2 ? WORST_PER_S : -WORST_PER_S, 20);
        double sum = 0;
        for (int k = 0; k < 20 * FRAMES_PER_S; k++) {
            step(&finger);
            assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
            sum += shared_error(&finger) / (20 * FRAMES_PER_S);
        }
        // One electrode's noise would allow a lag of 1.2 counts; all together allow a quarter of that.
        assert_true(fabs(sum) < 0.3);
    }
}

// A pressure that is missing, or that does not move in a press, would let a slow load pass for drift.
TEST(without_pressure_nothing_is_learned)
{
    for (int flat = 0; flat <= 1; flat++) {
        emulated_finger finger = new_finger();
        finger.has_pdc = flat;
        finger.tare.witness.flat = flat;
        finger.drift_per_s = WORST_PER_S;
        run_seconds(&finger, 60);
        assert_int_equal(finger.tare.drift.now.q20, 0);
    }
}

TEST(a_slow_load_is_not_learned)
{
    emulated_finger finger = worn_finger(1, 0, 20);
    for (int k = 0; finger.tare.state == BT_TARE_STATE_REST; k++) {
        assert_true(k < 10 * FRAMES_PER_S);
        finger.load += 1.6 / FRAMES_PER_S; // 0.02 N/s
        finger.pdc_load += 2.0 / FRAMES_PER_S;
        step(&finger);
    }
    // Extrapolated over a minute, it is no more than half a count.
    assert_true(fabs(finger.tare.drift.now.q20 / 1048576.0 * 750) < 1.5);
}

// ---- in a touch --------------------------------------------------------------------------------

TEST(a_hold_drifts_on)
{
    for (uint64_t seed = 1; seed <= 4; seed++) {
        emulated_finger finger = worn_finger(seed, seed % 2 ? WORST_PER_S : -WORST_PER_S, 20);
        press(&finger, 400, 300);
        for (int second = 0; second < 60; second++) {
            run_seconds(&finger, 1);
            assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
            assert_true(fabs(shared_error(&finger)) < 2); // 15 counts, were it not followed
        }
        assert_int_equal(finger.tare.sweep.still_sweeps, UINT8_MAX); // followed drift is no motion
    }
}

// Loading of each electrode, as on real sensors.
static double loading(int i)
{
    return 0.82 + 0.34 * (7 * i % BT_ELECTRODES) / (BT_ELECTRODES - 1);
}

TEST(an_hour_of_hold_keeps_a_force_down_to_the_noise)
{
    for (int worn = 0; worn < 2; worn++) {
        emulated_finger finger = new_finger();
        finger.sigma = worn ? 5 : 1.5;
        finger.pdc_sigma = 1;
        double worst_shared = 0, worst = 0;
        for (int k = 1; k <= 3660 * FRAMES_PER_S; k++) {
            finger.drift_per_s = -WORST_PER_S;
            finger.load = k < 20 * FRAMES_PER_S   ? 0
                          : k < 22 * FRAMES_PER_S ? 400
                                                  : 12; // 0.1 N of 80 counts/N
            finger.pdc_load = finger.load * 1.2;
            if (k == 20 * FRAMES_PER_S) {
                bt_tare_hold(&finger.tare);
            }
            bt_round frame = next_frame(&finger);
            double drift = finger.drift_per_s * finger.t_s;
            double shared = 0;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                frame.electrode[i] = to_count(frame.electrode[i] + (loading(i) - 1) * drift);
                double error = rest_count(&finger, i) + (loading(i) - 1) * drift
                               - finger.tare.base.electrode_q16[i] / 65536.0;
                shared += error / BT_ELECTRODES;
                worst = k > 60 * FRAMES_PER_S && fabs(error) > worst ? fabs(error) : worst;
            }
            worst_shared = k > 60 * FRAMES_PER_S && fabs(shared) > worst_shared ? fabs(shared) : worst_shared;
            (void)feed(&finger, &frame);
            assert_true(k < 25 * FRAMES_PER_S || finger.tare.state == BT_TARE_STATE_CONTACT);
        }
        print_message("sigma %.1f: of 900 counts %.2f are missing at most, %.2f of one electrode\n",
                      finger.sigma, worst_shared, worst);
        // With the default gains, 1.5 counts on every electrode are 0.1 N.
        assert_true(worst_shared < 1.5);
    }
}

// A finger under HOLD follows, untouched, each electrode's own drift.
TEST(what_is_held_at_rest_follows_each_electrodes_own_drift)
{
    emulated_finger finger = new_finger();
    run_seconds(&finger, 20);
    bt_tare_hold(&finger.tare);
    for (int sign = -1; sign <= 1; sign += 2) {
        const bt_baseline before = finger.tare.base;
        for (int k = 1; k <= 150 * FRAMES_PER_S; k++) {
            const double drift = (sign < 0 ? 0 : -36) + sign * 0.24 * k / FRAMES_PER_S;
            bt_round frame;
            bt_round_clear(&frame);
            finger.t_s += 1.0 / FRAMES_PER_S;
            frame.t_us = (uint32_t)llround(finger.t_s * 1e6);
            frame.pdc = PDC_REST;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                frame.electrode[i] = to_count(rest_count(&finger, i) + loading(i) * drift);
            }
            (void)feed(&finger, &frame);
        }
        assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            double moved = ((double)finger.tare.base.electrode_q16[i] - before.electrode_q16[i]) / 65536;
            // All alike would be off by 0.18 * 36 = 6.5 counts.
            assert_true(fabs(moved - sign * 36 * loading(i)) < 4);
        }
    }
}

TEST(drift_that_stops_in_a_hold_is_found_out)
{
    emulated_finger finger = worn_finger(3, WORST_PER_S, 20);
    press(&finger, 400, 300);
    double stopped = finger.drift_per_s * finger.t_s;
    for (int second = 0; second < 300; second++) {
        for (int k = 0; k < FRAMES_PER_S; k++) {
            finger.drift_per_s = stopped / (finger.t_s + 1.0 / FRAMES_PER_S);
            step(&finger);
        }
        assert_true(fabs(shared_error(&finger)) < 7); // 20 s of it while skin may creep, and the way back
    }
    assert_true(fabs(shared_error(&finger)) < 7);
    assert_true(fabs(finger.tare.drift.now.q20 / 1048576.0 * 12.5) < 0.05);
}

// ---- in a silence ------------------------------------------------------------------------------

TEST(a_young_hold_comes_back_from_a_silence_where_drift_has_taken_it)
{
    for (uint64_t seed = 1; seed <= 6; seed++) {
        emulated_finger finger = worn_finger(seed, seed % 2 ? WORST_PER_S : -WORST_PER_S, 20);
        press(&finger, 400, 300);
        run_seconds(&finger, 1);
        double before = shared_error(&finger);
        const bt_baseline base = finger.tare.base;
        finger.t_s += 10;
        run_frames(&finger, BT_SILENCE_ROUNDS);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
        for (int i = 0; i < BT_ELECTRODES; i++) { // each of them
            double moved = ((double)finger.tare.base.electrode_q16[i] - base.electrode_q16[i]) / 65536;
            assert_true(fabs(moved - 10 * finger.drift_per_s) < 0.6);
        }
        assert_true(fabs(shared_error(&finger) - before) < 0.5); // of 2.5
        run_seconds(&finger, 3);
        assert_true(fabs(shared_error(&finger) - before) < 0.5); // nor again later
    }
}

// A drift that was unknown before: the movement of all electrodes in the silence gives it.
TEST(a_hold_of_unknown_drift_follows_a_silence_too)
{
    emulated_finger finger = new_finger();
    run_seconds(&finger, 1);
    press(&finger, 400, 300);
    run_seconds(&finger, 6);
    assert_false(bt_drift_known(&finger.tare.drift));
    double before = shared_error(&finger);
    finger.t_s += 10;
    finger.drift_per_s = 2.5 / finger.t_s; // in the silence alone
    run_frames(&finger, BT_SILENCE_ROUNDS);
    assert_true(fabs(shared_error(&finger) - before) < 0.5);
}

TEST(a_load_that_changed_in_a_silence_is_no_drift)
{
    emulated_finger finger = worn_finger(1, WORST_PER_S, 20);
    press(&finger, 400, 300);
    run_seconds(&finger, 5);
    double before = shared_error(&finger);
    finger.t_s += 10;
    load_by(&finger, 600, 450);
    run_frames(&finger, BT_SILENCE_ROUNDS);
    assert_true(fabs(shared_error(&finger) - before) < 0.5);
}

// ---- temperature -------------------------------------------------------------------------------

TEST(what_gets_warmer_at_rest_is_not_counted_twice_in_a_touch)
{
    const double tdc_per_s = 0.4;
    emulated_finger finger = new_finger();
    finger.settings.thermal_gain_q16 = 1 << 15; // half a count for each of TDC
    finger.drift_per_s = tdc_per_s / 2;
    for (int k = 0; k < 60 * FRAMES_PER_S; k++) {
        if (k == 40 * FRAMES_PER_S) {
            load_by(&finger, 400, 300);
        }
        bt_round frame = next_frame(&finger);
        frame.tdc = to_count(1000 + tdc_per_s * finger.t_s);
        (void)feed(&finger, &frame);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_true(fabs(shared_error(&finger)) < 0.5); // 4 counts, twice
}

// Nothing drifted before: a silence and a fault leave a hold's tare as it was, to the last bit.
TEST(a_hold_without_drift_stays_as_it_is)
{
    emulated_finger finger = new_finger();
    run_seconds(&finger, 20);
    press(&finger, 400, 300);
    run_seconds(&finger, 5);
    const bt_baseline before = finger.tare.base;
    assert_true(bt_drift_known(&finger.tare.drift));
    finger.t_s += 10;
    run_seconds(&finger, 1);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
    feed_without(&finger, 2, 3, 0);
    run_seconds(&finger, 1);
    assert_memory_equal(&finger.tare.base, &before, sizeof before);
}
