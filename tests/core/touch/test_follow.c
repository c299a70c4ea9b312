// The snapshots that a touch goes back to, and the range of a baseline.
#include "emulated_finger.h"

// A snapshot every three sweeps; five of them back, where there are so many.
static void a_touch_goes_back_to_what_was_a_second_ago(void **state)
{
    (void)state;
    bt_rollback rollback;
    bt_baseline base = {.pdc_q16 = 7000};
    memset(&rollback, 0xFF, sizeof rollback);
    bt_rollback_start(&rollback, &base);
    assert_int_equal(bt_rollback_before(&rollback)->pdc_q16, 7000);
    assert_int_equal(bt_rollback_sweeps(&rollback), 0);
    for (uint32_t sweep = 1; sweep <= 100; sweep++) {
        base.pdc_q16 = 7000 + sweep;
        bt_rollback_keep(&rollback, &base);
        const uint32_t latest = sweep / 3 * 3, oldest = latest > 15 ? latest - 15 : 0;
        assert_int_equal(bt_rollback_before(&rollback)->pdc_q16, 7000 + oldest);
        assert_int_equal(bt_rollback_sweeps(&rollback), sweep - oldest);
    }
    for (unsigned lane = 0; lane < BT_LANES; lane++) {
        bt_rollback_fill(&rollback, lane, 50 + lane);
    }
    for (int k = 0; k < BT_SNAPSHOTS; k++) {
        assert_int_equal(rollback.snapshot[k].pdc_q16, 50 + BT_LANE_PDC);
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            assert_int_equal(rollback.snapshot[k].electrode_q16[i], 50 + i);
        }
    }
}

static void a_baseline_stays_in_its_range(void **state)
{
    (void)state;
    const uint32_t full_q16 = 4095u << 16;
    assert_int_equal(bt_baseline_moved(10, -10), 0);
    assert_int_equal(bt_baseline_moved(10, -11), 0);
    assert_int_equal(bt_baseline_moved(full_q16 - 10, 10), full_q16);
    assert_int_equal(bt_baseline_moved(full_q16 - 10, 11), full_q16);
    assert_int_equal(bt_baseline_moved(BT_TARE_UNKNOWN, -11), BT_TARE_UNKNOWN);
    for (uint32_t q16 = 5u << 16; q16 < 6u << 16; q16 += 7) {
        assert_int_equal(bt_baseline_count(q16), q16 < (5u << 16) + 32768 ? 5 : 6);
        assert_int_equal(bt_tare_q4(q16), (uint32_t)floor(q16 / 4096.0 + 0.5));
    }
    assert_int_equal(bt_tare_q4(BT_TARE_UNKNOWN), BT_INVALID_COUNT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_touch_goes_back_to_what_was_a_second_ago),
        cmocka_unit_test(a_baseline_stays_in_its_range),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
