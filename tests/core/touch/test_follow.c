// The snapshots that a touch goes back to.
#include "emulated_finger.h"

// A snapshot every three sweeps; five of them back, where there are so many.
TEST(a_touch_goes_back_to_what_was_a_second_ago)
{
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
}

int main(void)
{
    return run_all(NULL, NULL);
}
