// Means over eight rounds: each lane's against the brute force, whatever the phase.
#include "emulated_finger.h"

#define ROUNDS 8
#define SPAN   96

// All filtered counts there were.
typedef struct {
    int rounds;
    uint16_t smooth[4096][BT_LANES];
} history;

static history past;

// Eight times the mean of a lane's last eight counts; before there were eight, the first stands for what
// was not seen.
static uint32_t brute_q3(unsigned lane, int since)
{
    uint32_t sum = 0;
    for (int k = past.rounds - ROUNDS; k < past.rounds; k++) {
        sum += past.smooth[k < since ? since : k][lane];
    }
    return sum;
}

static void sweep_add(bt_sweep *sweep, const bt_lanes *smooth)
{
    memcpy(past.smooth[past.rounds++], smooth->lane, sizeof smooth->lane);
    bt_sweep_add(sweep, smooth);
}

static void random_lanes(uint64_t *seed, bt_lanes *smooth)
{
    // Ends of the range more often than not.
    static const int64_t ends[][2] = {{1, 4089}, {4089, 4089}, {1, 1}, {0, 4095}, {4095, 4095}};
    for (int i = 0; i < BT_LANES; i++) {
        const int64_t *range = ends[random_range(seed, 0, 4)];
        smooth->lane[i] = (uint16_t)random_range(seed, range[0], range[1]);
    }
}

TEST(every_mean_is_that_of_its_last_eight_rounds)
{
    uint64_t seed = 61;
    bt_sweep sweep;
    bt_lanes smooth;
    int closed = 0;
    for (int course = 0; course < 200; course++) { // each ends, and the next begins, at another phase
        past.rounds = 0;
        bt_sweep_restart(&sweep);
        int rounds = (int)random_range(&seed, 1, 60);
        for (int round = 0; round < rounds; round++) {
            random_lanes(&seed, &smooth);
            sweep_add(&sweep, &smooth);
            for (unsigned i = bt_sweep_first(&sweep); i < bt_sweep_end(&sweep); i++, closed++) {
                assert_int_equal(bt_sweep_close(&sweep, i, SPAN), brute_q3(i, 0));
                assert_int_equal(sweep.mean_q3.lane[i], brute_q3(i, 0));
            }
            assert_int_equal(bt_sweep_next(&sweep), round % ROUNDS == ROUNDS - 1);
        }
    }
    assert_true(closed > 1000);
}

TEST(a_lane_met_at_any_phase_has_its_first_word_for_what_was_before)
{
    uint64_t seed = 62;
    for (int at = 1; at < 3 * ROUNDS; at++) {
        for (unsigned lane = 0; lane < BT_LANES; lane++) {
            bt_sweep sweep;
            bt_lanes smooth;
            past.rounds = 0;
            bt_sweep_restart(&sweep);
            for (int round = 0; round < 5 * ROUNDS; round++) {
                random_lanes(&seed, &smooth);
                smooth.lane[lane] = round < at ? BT_TRIGGER_UNREAD : smooth.lane[lane];
                if (round == at) {
                    bt_sweep_fill(&sweep, lane, smooth.lane[lane]);
                    assert_int_equal(sweep.mean_q3.lane[lane], 8 * smooth.lane[lane]);
                }
                sweep_add(&sweep, &smooth);
                for (unsigned i = bt_sweep_first(&sweep); i < bt_sweep_end(&sweep); i++) {
                    uint16_t mean_q3 = bt_sweep_close(&sweep, i, SPAN);
                    bool unread = i == lane && round < at;
                    assert_int_equal(mean_q3, unread ? BT_SWEEP_UNREAD_Q3 : brute_q3(i, i == lane ? at : 0));
                }
                (void)bt_sweep_next(&sweep);
            }
        }
    }
}

// ---- stillness -------------------------------------------------------------------------------------

static void a_sweep_of(bt_sweep *sweep, const bt_lanes *smooth)
{
    for (int round = 0; round < ROUNDS; round++) {
        bt_sweep_add(sweep, smooth);
        for (unsigned i = bt_sweep_first(sweep); i < bt_sweep_end(sweep); i++) {
            (void)bt_sweep_close(sweep, i, SPAN);
        }
        (void)bt_sweep_next(sweep);
    }
}

TEST(still_sweeps_are_counted_and_saturate)
{
    bt_sweep sweep;
    bt_lanes smooth;
    for (int i = 0; i < BT_LANES; i++) {
        smooth.lane[i] = (uint16_t)(2000 + i);
    }
    bt_sweep_restart(&sweep);
    for (int sweeps = 1; sweeps <= 600; sweeps++) {
        a_sweep_of(&sweep, &smooth);
        assert_int_equal(sweep.still_sweeps, sweeps < 255 ? sweeps : 255);
    }
    bt_sweep_restart(&sweep);
    a_sweep_of(&sweep, &smooth);
    assert_int_equal(sweep.still_sweeps, 1);
}

TEST(any_mean_that_leaves_the_span_ends_the_stillness)
{
    for (unsigned lane = 0; lane < BT_LANES; lane++) {
        for (int change = -30; change <= 30; change++) {
            bt_sweep sweep;
            bt_lanes smooth;
            for (int i = 0; i < BT_LANES; i++) {
                smooth.lane[i] = 2000;
            }
            bt_sweep_restart(&sweep);
            for (int k = 0; k < 4; k++) {
                a_sweep_of(&sweep, &smooth);
            }
            // A window ends with its lane's turn, so the sweep of the change holds 3 lane / 8 rounds less.
            smooth.lane[lane] = (uint16_t)(2000 + change);
            int in_window = 1 + (int)lane / 3;
            a_sweep_of(&sweep, &smooth);
            bool moved = abs(change) * in_window > SPAN;
            assert_int_equal(sweep.still_sweeps, moved ? 0 : 5);
            a_sweep_of(&sweep, &smooth);
            // After a move the means of then are the settled ones; else they stay those of before.
            int from = moved ? 8 - in_window : 8;
            bool moved_again = abs(change) * from > SPAN;
            assert_int_equal(sweep.still_sweeps, moved_again ? 0 : moved ? 1 : 6);
            a_sweep_of(&sweep, &smooth);
            bool settled = moved || moved_again;
            assert_int_equal(sweep.still_sweeps, !settled ? 7 : moved_again ? 1 : 2);
        }
    }
}

// ---- in the machine --------------------------------------------------------------------------------

TEST(the_machine_serves_the_means_of_what_the_gate_let_through)
{
    uint64_t seed = 63;
    emulated_finger finger;
    finger_init(&finger);
    finger.sigma = 4;
    finger.glitch_chance = 0.02;
    past.rounds = 0;
    int since = 0;
    for (int k = 0; k < 4000; k++) {
        finger.load = k % 700 > 500 ? 300 : 0;
        bool fault = random_unit(&seed) < 0.01;
        unsigned first = bt_sweep_first(&finger.tare.sweep), end = bt_sweep_end(&finger.tare.sweep);
        bool starts_over = fault && finger.tare.partial;
        bt_round frame = fault ? frame_without(&finger, 5, 3, 0) : next_frame(&finger);
        (void)feed(&finger, &frame);
        if (fault) { // a sweep goes on with the next good round, if nothing had broken it yet
            since = starts_over ? past.rounds : since;
            continue;
        }
        memcpy(past.smooth[past.rounds++], finger.tare.trigger.smooth.lane, sizeof past.smooth[0]);
        for (unsigned i = first; i < end; i++) {
            assert_int_equal(finger.tare.sweep.mean_q3.lane[i], brute_q3(i, since));
        }
    }
}

int main(void)
{
    return run_all(NULL, NULL);
}
