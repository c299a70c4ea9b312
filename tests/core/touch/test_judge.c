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

// With sums of which all is a pattern, after so many rounds in contact and so many counts of temperature.
static bool is_residue(uint32_t energy_count2, uint32_t contact_rounds, int warm_count, bool pressure)
{
    emulated_finger finger = held();
    finger.settings.thermal_gain_q16 = 1 << 16;
    finger.tare.sweep.mean_q3.lane[BT_LANE_PDC] = 8 * PDC_REST;
    finger.tare.trigger.smooth.lane[BT_LANE_PDC] = PDC_REST;
    finger.tare.release.energy_peak = finger.tare.release.uneven_peak = 0;
    finger.tare.release.quiet_sweeps = pressure ? 0 : 100;
    finger.tare.contact_rounds = contact_rounds;
    finger.tare.thermal.tdc_q8 = (uint32_t)(1000 + warm_count) << 8;
    finger.tare.thermal.tdc_then_q8 = 1000 << 8;
    if (!pressure) {
        finger.tare.release.energy_peak = 4 * energy_count2 + 4; // it must have fallen
    }
    finger.tare.energy_count2 = energy_count2;
    finger.tare.sum_q4 = 0;
    finger.tare.pressure_seen = pressure;
    finger.tare.partial = false;
    bt_judge_sweep(&finger.tare, &finger.settings);
    return finger.tare.reason == BT_TARE_REASON_RESIDUE;
}

// A residue is below 400 and what is forgiven; of a stronger press, below a 64th of its own energy and that.
static void drift_and_temperature_are_forgiven_by_their_squares(void **state)
{
    (void)state;
    static const struct {
        uint32_t rounds, forgiven_count2; // 15 counts a minute, on 19 electrodes
        int warm_count;                   // a third of it
        bool pressure;
    } cases[] = {{0, 0, 0, true},         {399, 0, 0, true},      {400, 19, 0, true},
                 {4000, 1900, 0, true},   {3999, 1881, 0, true},  {0, 19 * 16, 12, true},
                 {0, 19 * 16, -12, true}, {400, 19 * 2, 3, true}, {0, 19 * 5, 7, true},
                 {4000, 0, 0, false},     {0, 19 * 16, 12, false}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const uint32_t limit = 400 + cases[k].forgiven_count2;
        const uint32_t rounds = cases[k].rounds;
        assert_false(is_residue(limit, rounds, cases[k].warm_count, cases[k].pressure));
        if (cases[k].forgiven_count2 > 0) { // or it is back at its tare
            assert_true(is_residue(limit - 1, rounds, cases[k].warm_count, cases[k].pressure));
        }
    }
    // No more than that of ten minutes: 150 counts on 19 electrodes, of a press of that energy.
    static const uint32_t long_rounds[] = {60000, 60001, 6000000, UINT32_MAX};
    const uint32_t limit = (uint32_t)(19 * 150 * 150 * 64.0 / 63);
    for (size_t k = 0; k < 4; k++) {
        assert_true(is_residue(limit - 64, long_rounds[k], 0, true));
        assert_false(is_residue(limit + 64, long_rounds[k], 0, true));
    }
    assert_false(is_residue(limit - 64, 59000, 0, true));
}

// One sweep's share of the rate, where pressure does not say whether it is drift; which fades.
static void a_sweep_that_tells_nothing_goes_on_as_before(void **state)
{
    (void)state;
    emulated_finger finger = held();
    finger.tare.drift.sweeps = 128; // it lasts for 1024 of them
    finger.tare.drift.rate_q20 = finger.tare.drift.sure_q20 = finger.tare.drift.waiting_q20 = 16 * 1024;
    finger.tare.pressure_seen = false;
    finger.tare.partial = true;
    bt_judge_sweep(&finger.tare, &finger.settings);
    assert_int_equal(finger.tare.drift_q16, 1024);
    assert_int_equal(finger.tare.drift.rate_q20, 16 * 1023);
}

// By 32 counts and no further from a mean may a word be that is to be tared.
static void what_moves_now_is_not_still(void **state)
{
    (void)state;
    const emulated_finger before = resting_finger();
    for (int i = 0; i < BT_ELECTRODES; i++) {
        for (int off = -33; off <= 33; off++) {
            bt_tare tare = before.tare;
            tare.trigger.smooth.lane[i] = (uint16_t)(tare.sweep.mean_q3.lane[i] / 8 + off);
            assert_int_equal(bt_tare_now(&tare), abs(off) <= 32 ? BT_ERROR_OK : BT_ERROR_NOT_STILL);
        }
    }
    for (uint8_t still = 1; still <= 2; still++) {
        bt_tare tare = before.tare;
        tare.sweep.still_sweeps = still;
        assert_int_equal(bt_tare_now(&tare), still == 2 ? BT_ERROR_OK : BT_ERROR_NOT_STILL);
    }
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
    tare->last.known = true;
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
    assert_false(finger.tare.tared || finger.tare.last.known || finger.tare.sweep.begun);
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

// A 64th of the press is missing at most, and no more than 16 counts; less than that is put back to rest.
static void pressure_that_a_press_has_left_missing_may_come_back(void **state)
{
    (void)state;
    static const int peaks[][2] = {{63, 0}, {64, 1}, {1023, 15}, {1024, 16}, {3000, 16}};
    for (int k = 0; k < 5; k++) {
        for (int below = -1; below <= 17; below++) {
            emulated_finger finger = held();
            finger.tare.release.pdc_peak = peaks[k][0];
            finger.tare.sweep.mean_q3.lane[BT_LANE_PDC] = (uint16_t)(8 * (PDC_REST - below));
            bt_adopt_after_press(&finger.tare, BT_TARE_REASON_RELEASE);
            assert_int_equal(finger.tare.comes_back_q16, peaks[k][1] << 16);
            const uint32_t base = (uint32_t)(below > 0 && below < 16 ? PDC_REST : PDC_REST - below);
            assert_int_equal(finger.tare.base.pdc_q16, base << 16);
            assert_int_equal(finger.tare.trigger.rest.lane[BT_LANE_PDC], base);
            assert_int_equal(bt_rollback_before(&finger.tare.rollback)->pdc_q16, base << 16);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uneven_is_the_energy_around_the_mean),
        cmocka_unit_test(drift_and_temperature_are_forgiven_by_their_squares),
        cmocka_unit_test(a_sweep_that_tells_nothing_goes_on_as_before),
        cmocka_unit_test(what_moves_now_is_not_still),
        cmocka_unit_test(a_new_tare_begins_with_nothing_of_the_contact),
        cmocka_unit_test(every_change_of_state_waits_for_three_hits_again),
        cmocka_unit_test(a_touch_right_after_a_doubt_is_one),
        cmocka_unit_test(pressure_that_a_press_has_left_missing_may_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
