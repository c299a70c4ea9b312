// A hold's watched baseline after a silence (SPEC.md, Tare); courses: test_drift.c, tests/stability.
#include "support.h"

#include "touch/watch.h"

#define SPAN_Q3     96
#define REST_Q3     (8 * 1326) // of the pressure
#define SWEEPS      100        // of silence
#define COUNT_Q16   65536
#define LEVEL_SINCE 40

typedef struct {
    bt_watch watch;
    bt_silence silence;
} hold;

// Every electrode read 3000 counts after the silence, away_q3 more than where it was watched.
static hold after(const int16_t away_q3[BT_ELECTRODES], int pressure_q3)
{
    hold held = {.watch = {.level_q3 = REST_Q3, .level_sweeps = LEVEL_SINCE}, .silence = {.sweeps = SWEEPS}};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        held.watch.base.electrode_q16[i] = (uint32_t)(8 * 3000 - away_q3[i]) << 13;
        held.silence.sum.lane[i] = 3000 * BT_SILENCE_ROUNDS;
    }
    held.silence.sum.lane[BT_LANE_PDC] = (uint16_t)((REST_Q3 + pressure_q3) / 8 * BT_SILENCE_ROUNDS);
    return held;
}

static hold after_even(int16_t each_q3, int pressure_q3)
{
    int16_t away_q3[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        away_q3[i] = each_q3;
    }
    return after(away_q3, pressure_q3);
}

static int32_t resumed(hold held)
{
    return bt_watch_resume(&held.watch, &held.silence, SPAN_Q3);
}

TEST(what_is_no_drift_is_not_followed)
{
    const int32_t most = resumed(after_even(64, 0)); // the worst drift that there is
    assert_in_range(most, 1, 7 * COUNT_Q16);
    assert_int_equal(resumed(after_even(100, 0)), most);
    assert_int_equal(resumed(after_even(-100, 0)), -most);
    assert_int_equal(resumed(after_even(8, 30 * 8)), 0); // nor is a load, by the pressure
    int16_t away_q3[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        away_q3[i] = i % 2 ? 8 : -8;
    }
    assert_int_equal(resumed(after(away_q3, 0)), 0); // they do not go one way
    for (int i = 0; i < BT_ELECTRODES; i++) {
        away_q3[i] = 16;
    }
    away_q3[7] = 300;
    hold outlier = after(away_q3, 0);
    assert_int_equal(resumed(outlier), 0);
    outlier.watch.base.electrode_q16[7] = BT_TARE_UNKNOWN; // says nothing
    assert_true(resumed(outlier) != 0);
    hold waits = after_even(8, 0);
    waits.watch.wait_sweeps = 1; // the watched level is not the level of rest
    assert_int_equal(resumed(waits), 0);
}

// Sweeps after pressure has moved, in which all electrodes move by step_q3 and one by `times` that, until all
// have moved alike by 3 counts; 0: never in three seconds.
static int sweeps_until_alike(int step_q3, int times)
{
    bt_watch watch = {.level_q3 = REST_Q3};
    bt_sweep sweep = {0};
    const uint16_t pressure_q3 = REST_Q3;
    bt_watch_begin(&watch);
    for (int k = 1; k < 38; k++) {
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            sweep.mean_q3.lane[i] = (uint16_t)(8 * 2000 + k * step_q3 * (i == 5 ? times : 1));
            if (watch.early) {
                uint32_t mean_q16 = (uint32_t)sweep.mean_q3.lane[i] << 13;
                uint32_t away_q3 = bt_abs32(bt_watch_side(&watch, mean_q16, watch.base.electrode_q16[i]));
                watch.farthest_q3 = away_q3 > watch.farthest_q3 ? away_q3 : watch.farthest_q3;
            }
        }
        bt_watch_end(&watch, &pressure_q3);
        bt_watch_wait(&watch, &sweep, 0);
        if (watch.alike && bt_abs32(watch.shared_q16) > 3 * COUNT_Q16) {
            return k;
        }
    }
    return 0;
}

TEST(what_moves_all_alike_is_seen_before_it_comes_to_rest)
{
    assert_int_equal(sweeps_until_alike(19, 1), 4); // 30 counts/s, which never rests
    assert_int_equal(sweeps_until_alike(-13, 2), 4);
    assert_int_equal(sweeps_until_alike(13, 5), 0); // a press that moves all one way
}
