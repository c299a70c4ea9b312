// How long a finger was away, by device time, and what its first rounds read: by counting, round for round.
#include "signal/silence.h"
#include "support.h"

#define ROUND_US 10000u
#define SWEEP_US 80000u
#define PAIRS    (BT_LANES / 2)

static uint32_t t_us;

// `gap_us` after the round before, whose pairs all hold `level`.
static bool next(bt_silence *silence, uint32_t gap_us, uint32_t level)
{
    bt_lanes lanes;
    for (unsigned k = 0; k < PAIRS; k++) {
        lanes.pair[k] = level + k;
    }
    return bt_silence_add(silence, t_us += gap_us, &lanes);
}

static bt_silence on_time(void)
{
    bt_silence silence = {0};
    t_us = 0;
    for (unsigned round = 0; round < 20; round++) {
        assert_false(next(&silence, ROUND_US, 7));
    }
    assert_int_equal(silence.sweeps, 0);
    return silence;
}

// The rounds that follow a silence: the last of them says so, and has the sum of all.
static void comes_back(bt_silence *silence, uint32_t gap_us, unsigned sweeps)
{
    for (unsigned round = 0; round < BT_SILENCE_ROUNDS; round++) {
        assert_int_equal(next(silence, round == 0 ? gap_us : ROUND_US, 100 * (round + 1)),
                         round + 1 == BT_SILENCE_ROUNDS);
    }
    assert_int_equal(silence->sweeps, sweeps);
    for (unsigned k = 0; k < PAIRS; k++) {
        assert_int_equal(silence->sum.pair[k], 100 * (1 + 2 + 3 + 4 + 5) + 5 * k);
    }
    for (unsigned round = 0; round < 10; round++) {
        assert_false(next(silence, ROUND_US, 9)); // told once
    }
}

TEST(rounds_that_are_lost_are_no_silence)
{
    bt_silence silence = on_time();
    assert_false(next(&silence, ROUND_US + SWEEP_US - 1, 1));
    for (unsigned round = 0; round < 10; round++) {
        assert_false(next(&silence, ROUND_US, 1));
    }
    assert_int_equal(silence.sweeps, 0);
}

TEST(a_silence_is_counted_in_whole_sweeps_and_told_once)
{
    const struct {
        uint32_t gap_us;
        unsigned sweeps;
    } cases[] = {{90000, 1}, {169999, 1}, {170000, 2}, {10010000, 125}, {3600010000u, 45000}};
    for (unsigned k = 0; k < sizeof cases / sizeof *cases; k++) {
        bt_silence silence = on_time();
        comes_back(&silence, cases[k].gap_us, cases[k].sweeps);
    }
}

TEST(one_after_another_is_counted_alone)
{
    bt_silence silence = on_time();
    comes_back(&silence, ROUND_US + 10 * SWEEP_US, 10);
    comes_back(&silence, ROUND_US + 3 * SWEEP_US, 3);
}

TEST(one_in_the_middle_of_coming_back_adds_to_it)
{
    bt_silence silence = on_time();
    assert_false(next(&silence, ROUND_US + 10 * SWEEP_US, 1));
    assert_false(next(&silence, ROUND_US, 1));
    comes_back(&silence, ROUND_US + 3 * SWEEP_US, 13); // and its sums are the later rounds' alone
}

TEST(what_does_not_fit_stays_at_its_largest)
{
    bt_silence silence = on_time();
    assert_false(next(&silence, ROUND_US + 50000 * SWEEP_US, 1));
    comes_back(&silence, ROUND_US + 50000 * SWEEP_US, UINT16_MAX);
}

int main(void)
{
    return run_all(NULL, NULL);
}
