// The effect of temperature on the tare in contact, against the low-pass in closed form.
//
// After n sweeps of a step by d the low-pass of 8 rounds has moved by d (1 - (7/8)^8n). It is kept in 1/256
// count and each round cuts off less than one of them; 7/8 of that error are left in the next: together less
// than 8/256.
#include "emulated_finger.h"

#include "solve/results.h"

#define CUT   (8.0 / 256)
#define APART 1000.0 // the bound: 500 counts up, 500 down
#define T0    1000
#define SWEEP BT_SWEEP_ROUNDS

static uint16_t tdc_now; // the reading of the finger's thermometer

static void warm_round(emulated_finger *finger)
{
    bt_round frame = next_frame(finger);
    frame.tdc = tdc_now;
    (void)feed(finger, &frame);
}

static void warm_rounds(emulated_finger *finger, int rounds)
{
    for (int k = 0; k < rounds; k++) {
        warm_round(finger);
    }
}

static emulated_finger warm_finger(int gain_milli)
{
    emulated_finger finger = new_finger();
    finger.settings.thermal_gain_q16 = bt_thermal_gain_q16(gain_milli);
    finger.has_pdc = false; // with a level pressure, drift would be followed besides
    tdc_now = T0;
    warm_rounds(&finger, 500);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    return finger;
}

// Held in contact, at the begin of a sweep.
static void grasp(emulated_finger *finger)
{
    load_by(finger, 400, 300);
    warm_rounds(finger, 5);
    assert_int_equal(finger->tare.state, BT_TARE_STATE_CONTACT);
    while (finger->tare.sweep.round != 0) {
        warm_round(finger);
    }
}

static emulated_finger held_finger(int gain_milli)
{
    emulated_finger finger = warm_finger(gain_milli);
    grasp(&finger);
    return finger;
}

static double moved(const emulated_finger *finger, const bt_baseline *from, int i)
{
    return ((double)finger->tare.base.electrode_q16[i] - from->electrode_q16[i]) / 65536;
}

static double low_passed(double step, double sweeps)
{
    return step * (1 - pow(7.0 / 8, SWEEP * sweeps));
}

static double clipped(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

// The tare's move that n sweeps of a TDC step must have made.
static void assert_followed(const emulated_finger *finger, const bt_baseline *from, int gain_milli,
                            double step, double sweeps)
{
    double gain = gain_milli / 1000.0;
    double want = gain * low_passed(step, sweeps);
    double off = fabs(gain) * CUT + fabs(step) * 0.5 / 65536 + 1.0 / 65536; // a gain and a product in q16
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double start = from->electrode_q16[i] / 65536.0;
        double low = clipped(start + clipped(want - off, -APART / 2, APART / 2), 0, 4095) - start;
        double high = clipped(start + clipped(want + off, -APART / 2, APART / 2), 0, 4095) - start;
        double got = moved(finger, from, i);
        if (got < low || got > high) {
            fail_msg("E%d moved by %.5f, not %.5f..%.5f; gain %d, step %g, %g sweeps", i + 1, got, low, high,
                     gain_milli, step, sweeps);
        }
        assert_int_equal(finger->tare.electrode_q4[i], bt_tare_q4(finger->tare.base.electrode_q16[i]));
        if (finger->tare.state == BT_TARE_STATE_CONTACT) {
            assert_int_equal(finger->tare.trigger.rest.lane[i], lround(start + got));
        }
    }
}

TEST(the_tare_follows_the_temperature_in_contact)
{
    static const int gains[] = {970, 1, -5000};
    static const int steps[] = {1, 40, -90};
    for (int g = 0; g < 3; g++) {
        emulated_finger held = held_finger(gains[g]);
        for (int s = 0; s < 3; s++) {
            emulated_finger finger = held;
            bt_baseline before = finger.tare.base;
            tdc_now = (uint16_t)(T0 + steps[s]);
            for (int sweep = 1; sweep <= 80; sweep++) {
                warm_rounds(&finger, SWEEP);
                assert_followed(&finger, &before, gains[g], steps[s], sweep - 1);
            }
            assert_int_equal(finger.tare.base.pdc_q16, before.pdc_q16); // pressure is not followed
        }
    }
}

TEST(the_ends_of_gain_and_temperature_are_bounded)
{
    for (int up = 0; up < 2; up++) {
        for (int gain = -5000; gain <= 5000; gain += 5000) {
            emulated_finger finger = new_finger();
            finger.settings.thermal_gain_q16 = bt_thermal_gain_q16(gain);
            tdc_now = up ? 1 : 4089;
            warm_rounds(&finger, 500);
            // Tares near both ends too, where the range ends before the bound.
            for (int i = 0; i < BT_ELECTRODES; i++) {
                finger.tare.base.electrode_q16[i] = (uint32_t)(i % 3 == 0   ? 90
                                                               : i % 3 == 1 ? 2000
                                                                            : 4000)
                                                    << 16;
            }
            bt_baseline base = finger.tare.base;
            assert_int_equal(bt_tare_set(&finger.tare, &base, 0), BT_ERROR_OK);
            warm_rounds(&finger, 3);
            grasp(&finger);
            assert_memory_equal(&finger.tare.base, &base, sizeof base);
            double step = up ? 4088 : -4088;
            tdc_now = up ? 4089 : 1;
            for (int sweep = 1; sweep <= 100; sweep++) {
                warm_rounds(&finger, SWEEP);
            }
            assert_followed(&finger, &base, gain, step, 99);
        }
    }
}

static bool flagged(const emulated_finger *finger, uint32_t warmed_max_q8)
{
    bt_round frame = {.tdc = tdc_now}; // counts of 0: no electrode is missing, as the tare knows
    bt_msg_frame msg;
    bt_solve_settings settings = {.warmed_max_q8 = warmed_max_q8};
    bt_results(&frame, &finger->tare, &settings, 0, &msg);
    return msg.flags & BT_FRAME_FLAG_TEMP;
}

TEST(a_degree_is_flagged_in_contact_alone)
{
    static const int steps[] = {-100, -34, -33, 33, 34, 100};
    for (int s = 0; s < 6; s++) {
        const int step = steps[s];
        emulated_finger finger = held_finger(0);
        tdc_now = (uint16_t)(T0 + step);
        for (int sweep = 1; sweep <= 60; sweep++) {
            warm_rounds(&finger, SWEEP);
            bool flag = flagged(&finger, BT_DEGREE_Q8);
            double warmed = low_passed(step, sweep); // less at most CUT, towards minus infinity
            if (fabs(warmed) > 33 && fabs(warmed - CUT) > 33) {
                assert_true(flag);
            } else if (fabs(warmed) <= 33 && fabs(warmed - CUT) <= 33) {
                assert_false(flag);
            }
        }
        load_by(&finger, 0, 0);
        warm_rounds(&finger, 100);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
        tdc_now = T0;
        warm_rounds(&finger, 500);
        assert_false(flagged(&finger, BT_DEGREE_Q8));
    }
}
