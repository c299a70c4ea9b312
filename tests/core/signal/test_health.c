// How words are condemned and believed again, on a sensor made of numbers; results of broken and healthy
// sensors: tests/faults/test_sensor_faults.py.
#include "emulated_finger.h"

#include "signal/health.h"

#define SIGMA 1.5

static bt_health health;
static bt_trigger trigger;
static bt_round sampled;
static bt_noise noise;
static uint64_t seed;
static bool touched;
static uint32_t wrongs; // electrodes with wrong words

BEFORE_EACH(begin)
{
    health = (bt_health){0};
    bt_trigger_reset(&trigger);
    memset(&sampled, 0, sizeof sampled);
    noise = (bt_noise){.count2 = 43, .sigma_q4 = 24}; // of 19 electrodes with SIGMA
    seed = 77;
    touched = false;
    wrongs = 1u << 4;
}

static void end_round(void)
{
    bt_health_round(&health, &sampled, &trigger, &noise, touched);
    bt_trigger_leave_out(&trigger, health.out);
}

// A round of a skin that is moved by `moved` counts in all, a third of it one electrode's, as pressure shows;
// `wrong` is added to the words of `wrongs`.
static void run_round(double moved, double wrong)
{
    bt_trigger_begin(&trigger, BT_TRIGGER_NEVER);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        double count =
            2500 + 20 * i + moved * load_shape((int)i) + SIGMA * gauss(&seed) + (wrongs >> i & 1 ? wrong : 0);
        uint16_t word = to_count(count);
        sampled.electrode[i] = word;
        bt_trigger_follow(&trigger, i, word);
    }
    (void)bt_trigger_pressure(&trigger, to_count(1326 + moved / 4 + gauss(&seed)), INT32_MAX);
    end_round();
}

static void rounds(int n, double moved, double wrong)
{
    for (int k = 0; k < n; k++) {
        run_round(moved, wrong);
    }
}

static void expect_out(uint32_t out, uint8_t fault)
{
    assert_int_equal(health.out, out);
    assert_int_equal(health.electrode_fault, fault);
}

TEST(what_jumps_to_and_fro_is_condemned_within_a_tenth_of_a_second)
{
    touched = true;
    rounds(200, 300, 0);
    for (int k = 0; k < 10; k++) {
        run_round(300 + 20 * k, k % 2 ? 200 : -200); // in the middle of a squeeze
    }
    expect_out(1u << 4, BT_SENSOR_FAULT_NOISY);
    rounds(40, 500, 0);
    wrongs = 1u << 7; // later another one, too
    for (int k = 0; k < 40; k++) {
        run_round(500, k % 2 ? 200 : -200);
    }
    expect_out(1u << 4 | 1u << 7, BT_SENSOR_FAULT_NOISY);
}

// From the fourth electrode on, `n` in a row repeat the last count.
static void stick(unsigned n, int rounds, double per_round)
{
    bt_round kept = sampled;
    for (int k = 1; k <= rounds; k++) {
        bt_trigger_begin(&trigger, BT_TRIGGER_NEVER);
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            double count = 2500 + 20 * i + per_round * k * load_shape((int)i) + SIGMA * gauss(&seed);
            sampled.electrode[i] = i - 4 < n ? kept.electrode[i] : to_count(count);
            bt_trigger_follow(&trigger, i, sampled.electrode[i]);
        }
        (void)bt_trigger_pressure(&trigger, to_count(1326 + per_round * k / 4 + gauss(&seed)), INT32_MAX);
        end_round();
    }
}

TEST(what_sticks_is_condemned_once_the_skin_moves_and_its_neighbours_too)
{
    for (unsigned n = 1; n <= 5; n++) {
        begin();
        touched = true;
        rounds(1100, 0, 0); // more than two are believed after ten seconds
        stick(n, 20, 20);
        assert_int_equal(health.out, 0); // only suspected
        stick(n, 20, 20);
        expect_out(((1u << n) - 1) << 4, BT_SENSOR_FAULT_STUCK);
        stick(n, 400, 0);
        bt_health_back(&health);
        assert_int_equal(health.out, ((1u << n) - 1) << 4); // calm, but it still says the same
    }
}

TEST(words_that_all_repeat_are_a_frozen_sensor_until_one_changes)
{
    for (unsigned railed = 0; railed <= 2; railed++) {
        begin();
        rounds(200, 0, 0);
        for (int k = 0; k < 30; k++) {
            bt_trigger_begin(&trigger, BT_TRIGGER_NEVER);
            for (unsigned i = 0; i < BT_ELECTRODES; i++) {
                bt_trigger_follow(&trigger, i, i < railed ? 0 : sampled.electrode[i]);
            }
            end_round();
            if (k < 7 || k >= 15) {
                assert_int_equal(health.sensor_fault, k < 7 ? BT_SENSOR_FAULT_NONE : BT_SENSOR_FAULT_FROZEN);
            }
        }
        rounds(8, 0, 0);
        assert_int_equal(health.sensor_fault, BT_SENSOR_FAULT_NONE);
    }
}

TEST(a_condemned_electrode_comes_back_after_two_calm_seconds_where_it_rests)
{
    rounds(200, 0, 0);
    rounds(100, 0, -300);
    for (int k = 0; k < 400; k++) {
        run_round(0, k % 50 < 25 ? 0 : -20); // not calm
        bt_health_back(&health);
        expect_out(1u << 4, BT_SENSOR_FAULT_ALONE);
    }
    rounds(400, 0, -40); // calm, but it may be pressed
    bt_health_back(&health);
    expect_out(1u << 4, BT_SENSOR_FAULT_ALONE);
    for (int k = 0; k < 260; k++) {
        bt_health_back(&health);
        assert_int_equal(health.out, k < 200 ? 1u << 4 : health.out);
        run_round(0, 0);
    }
    expect_out(0, BT_SENSOR_FAULT_NONE);
}
