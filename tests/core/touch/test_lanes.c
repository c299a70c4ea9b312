// Lanes of the trigger that come late, or never.
#include "emulated_finger.h"

#define LIMIT 1000

static void lanes_that_were_never_read_add_no_energy(void **state)
{
    (void)state;
    static const uint16_t bad[] = {BT_INVALID_COUNT, 0, 4090, 4095};
    bt_trigger trigger;
    bt_trigger_reset(&trigger);
    for (int round = 0; round < 20; round++) {
        bt_trigger_begin(&trigger, LIMIT);
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            (void)bt_trigger_electrode(&trigger, i, i % 2 ? 2000 : bad[round % 4]);
        }
        assert_int_equal(bt_trigger_energy(&trigger), 0);
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            assert_int_equal(trigger.unknown >> i & 1, i % 2 == 0);
        }
    }
}

static void any_good_word_can_be_a_lanes_first(void **state)
{
    (void)state;
    for (uint16_t first = 1; first <= 4089; first++) {
        bt_trigger trigger;
        bt_trigger_reset(&trigger);
        bt_trigger_begin(&trigger, LIMIT);
        (void)bt_trigger_electrode(&trigger, 7, first);
        assert_int_equal(bt_trigger_energy(&trigger), 0);
        assert_int_equal(trigger.smooth.lane[7], first);
        assert_int_equal(trigger.rest.lane[7], first);
        assert_false(trigger.unknown >> 7 & 1);
        (void)bt_trigger_pressure(&trigger, first, 6);
        assert_true(trigger.room >= 0);
        assert_false(trigger.unknown >> BT_LANE_PDC & 1);
    }
}

static void a_tare_from_the_host_holds_from_the_second_word_on(void **state)
{
    (void)state;
    for (int first = -30; first <= 30; first++) {
        emulated_finger finger;
        finger_init(&finger);
        bt_baseline base = {.pdc_q16 = BT_TARE_UNKNOWN};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            base.electrode_q16[i] = (uint32_t)(rest_count(&finger, i) - first) << 16;
        }
        assert_int_equal(bt_tare_set(&finger.tare, &base), BT_ERROR_OK);
        bt_round frame = next_frame(&finger);
        assert_int_equal(feed(&finger, &frame), -1);
        assert_int_equal(bt_trigger_energy(&finger.tare.trigger), 0);
        // The electrode with which (i + 1) first^2 passes 1000.
        int seen = first == 0 ? BT_ELECTRODES : SETTING_COUNT2 / (first * first);
        assert_int_equal(feed(&finger, &frame), seen < BT_ELECTRODES ? seen : -1);
        assert_int_equal(bt_trigger_energy(&finger.tare.trigger), 19 * first * first);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lanes_that_were_never_read_add_no_energy),
        cmocka_unit_test(any_good_word_can_be_a_lanes_first),
        cmocka_unit_test(a_tare_from_the_host_holds_from_the_second_word_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
