// What a sweep's sums come to, and which tare each verdict leaves: one sweep by hand in a machine that runs.
#include "emulated_finger.h"

#include "touch/adopt.h"
#include "touch/judge.h"

// The sweep in which finger, held for long, shows these sums of its electrodes.
static void ends(emulated_finger *finger, uint32_t energy_count2, int32_t sum_q4)
{
    finger->tare.energy_count2 = energy_count2;
    finger->tare.sum_q4 = sum_q4;
    finger->tare.pressure_seen = true;
    finger->tare.partial = false;
    bt_judge_sweep(&finger->tare, &finger->settings);
}

static emulated_finger held(void)
{
    static emulated_finger finger; // the same each time
    if (finger.t_s == 0) {
        finger = touched_finger(400, 300);
        run_seconds(&finger, 3);
        assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    }
    return finger;
}

// Energy around the mean: e^2 - (sum e)^2 / 19, by the comment off by less than a millionth of what is taken.
static void uneven_is_the_energy_around_the_mean(void **state)
{
    (void)state;
    emulated_finger finger = held();
    uint64_t seed = 31;
    for (int k = 0; k < 3000; k++) {
        double sum = 0, energy = 0;
        const int most = k % 2 ? 4095 : 40, apart = k % 3 ? most : 4;
        const int64_t mean = random_range(&seed, -most, most);
        int32_t sum_q4 = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            double e = (double)(mean + random_range(&seed, -apart, apart));
            e = e > most ? most : e < -most ? -most : e;
            sum += e;
            energy += e * e;
            sum_q4 += (int32_t)(16 * e);
        }
        finger.tare.release.uneven_peak = 0;
        ends(&finger, (uint32_t)energy, sum_q4);
        const double even = sum * sum / 19, want = energy - even;
        assert_true(fabs(finger.tare.release.uneven_peak - want) <= 1 + even * 1e-6);
        finger.tare.state = BT_TARE_STATE_CONTACT;
    }
    finger.tare.release.uneven_peak = 0;
    ends(&finger, 1000, 16 * 200); // 2105 of them, which cannot be: rounding
    assert_int_equal(finger.tare.release.uneven_peak, 0);
}

// ---- what is adopted ---------------------------------------------------------------------------

static emulated_finger used(void)
{
    emulated_finger finger = held();
    bt_tare *tare = &finger.tare;
    tare->hits = 2;
    tare->let_go = true;
    tare->comes_back_q16 = 7;
    tare->partial = false;
    tare->thermal.applied_q16 = tare->thermal.step_q16 = 9;
    tare->thermal.tdc_q8 = 5000;
    tare->watch.wait_sweeps = 0;
    tare->watch.creeps = 100;
    tare->inverted_rounds = 2;
    return finger;
}

static void a_new_tare_begins_with_nothing_of_the_contact(void **state)
{
    (void)state;
    emulated_finger finger = used();
    bt_tare *tare = &finger.tare;
    const bt_baseline base = tare->base;
    assert_true(tare->release.energy_peak > 0 && tare->contact_rounds > 0 && tare->age_rounds > 0);
    bt_adopt(tare, &base, BT_TARE_STATE_REST, BT_TARE_REASON_SHIFT);
    assert_int_equal(tare->hits, 0);
    assert_int_equal(tare->contact_rounds, 0);
    assert_int_equal(tare->age_rounds, 0);
    assert_int_equal(tare->comes_back_q16, 0);
    assert_false(tare->let_go);
    assert_true(tare->partial && tare->tared && tare->changed);
    assert_int_equal(tare->release.energy_peak, 0);
    assert_int_equal(tare->release.pdc_peak, 0);
    assert_int_equal(tare->thermal.applied_q16, 0);
    assert_int_equal(tare->thermal.step_q16, 0);
    assert_int_equal(tare->thermal.tdc_then_q8, 5000);
    assert_int_equal(tare->watch.wait_sweeps, 5);
    assert_int_equal(tare->watch.creeps, 0);
    assert_int_equal(tare->rollback.count, 1);
}

static void every_change_of_state_waits_for_three_hits_again(void **state)
{
    (void)state;
    emulated_finger finger = used();
    bt_adopt_doubt(&finger.tare);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_DOUBT);
    assert_int_equal(finger.tare.hits, 0);
    assert_int_equal(finger.tare.watch.base.electrode_q16[3],
                     (uint32_t)finger.tare.sweep.mean_q3.lane[3] << 13);
    finger = used();
    bt_adopt_contact(&finger.tare);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_int_equal(finger.tare.hits, 0);
    finger = used();
    bt_adopt_none(&finger.tare);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_INIT);
    assert_int_equal(finger.tare.hits, 0);
    assert_false(finger.tare.tared || finger.tare.inverted_rounds != 0 || finger.tare.sweep.begun);
    assert_true(finger.tare.partial);
    finger = used();
    bt_round faulty = frame_without(&finger, 2, 3, 0);
    (void)feed(&finger, &faulty);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_FAULT);
    assert_int_equal(finger.tare.before_fault, BT_TARE_STATE_CONTACT);
    assert_int_equal(finger.tare.hits, 0);
    assert_int_equal(finger.tare.thermal.step_q16, 0); // lost rather than had twice
    assert_true(finger.tare.partial && !finger.tare.sweep.begun);
    finger.tare.release.quiet_sweeps = 9; // those were in a row, and no longer are
    step(&finger);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_CONTACT);
    assert_int_equal(finger.tare.release.quiet_sweeps, 0);
}

// A press from rest fires in three rounds; the second of them is the first that tells no more.
static void a_touch_right_after_a_doubt_is_one(void **state)
{
    (void)state;
    emulated_finger finger = held();
    finger.load = 40;
    finger.pdc_load = 30;
    (void)run_until(&finger, BT_TARE_STATE_DOUBT, 80);
    for (int round = 1; round <= 3; round++) {
        bt_round frame = next_frame(&finger);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            frame.electrode[i] = (uint16_t)(frame.electrode[i] + 15); // not far: nothing is held back
        }
        assert_int_equal(feed(&finger, &frame) >= 0, round == 1);
        assert_int_equal(finger.tare.state, round < 3 ? BT_TARE_STATE_DOUBT : BT_TARE_STATE_CONTACT);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uneven_is_the_energy_around_the_mean),
        cmocka_unit_test(a_new_tare_begins_with_nothing_of_the_contact),
        cmocka_unit_test(every_change_of_state_waits_for_three_hits_again),
        cmocka_unit_test(a_touch_right_after_a_doubt_is_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
