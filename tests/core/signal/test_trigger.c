// The trigger at the edges, and without excluded electrodes; touches, glitches and losses: test_tare*.c,
// test_lateness.c.
#include "emulated_finger.h"

#define LIMIT 1000

// A trigger with every electrode read at rest once.
static bt_trigger rested_trigger(const uint16_t rest[BT_ELECTRODES])
{
    bt_trigger trigger;
    bt_trigger_reset(&trigger);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        (void)bt_trigger_electrode(&trigger, i, rest[i]);
    }
    assert_int_equal(bt_trigger_energy(&trigger), 0);
    return trigger;
}

static uint32_t round_energy(bt_trigger *trigger, int32_t limit, const uint16_t word[BT_ELECTRODES])
{
    bt_trigger_begin(trigger, limit);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        (void)bt_trigger_electrode(trigger, i, word[i]);
    }
    return bt_trigger_energy(trigger);
}

// A signal at the threshold is no touch, nor is one that uses up all room; one more of either is.
TEST(the_edges_of_pressure_and_room_are_no_touch)
{
    uint16_t counts[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        counts[i] = 2000;
    }
    for (int room = 0; room <= 1; room++) {
        for (int above = 6; above <= 7; above++) {
            bt_trigger trigger = rested_trigger(counts);
            trigger.rest.lane[BT_LANE_PDC] = trigger.smooth.lane[BT_LANE_PDC] = 1000;
            trigger.unknown = 0;
            bt_trigger_begin(&trigger, 100 + room);
            assert_int_equal(bt_trigger_electrode(&trigger, 3, 2010), room);
            assert_int_equal(bt_trigger_pressure(&trigger, (uint16_t)(1000 + above), 6) < 0, above == 7);
            assert_int_equal(bt_trigger_energy(&trigger), 100);
        }
    }
    for (int off = 24; off <= 25; off++) { // a word that is far is held back
        for (int sign = -1; sign <= 1; sign += 2) {
            bt_trigger trigger = rested_trigger(counts);
            bt_trigger_begin(&trigger, 10000);
            (void)bt_trigger_electrode(&trigger, 3, (uint16_t)(2000 + sign * off));
            assert_int_equal(bt_trigger_energy(&trigger), off == 24 ? 24 * 24 : 0);
        }
    }
}

TEST(an_electrode_that_is_left_out_is_not_used)
{
    uint16_t rest[BT_ELECTRODES], word[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        rest[i] = 2000;
        word[i] = i == 4 ? 1000 : i == 7 ? 1980 : 2000;
    }
    bt_trigger trigger = rested_trigger(rest);
    bt_trigger_leave_out(&trigger, 1u << 4);
    for (int round = 0; round < 3; round++) {
        assert_int_equal(round_energy(&trigger, LIMIT, word), 400); // of E8 alone
        assert_int_equal(trigger.without, 1u << 4);
    }
}

TEST(the_ends_of_the_range_do_not_overflow)
{
    static const int32_t limits[] = {50, 1000, 3 * BT_SETTING_CONTACT_ENERGY_COUNT2_MAX};
    uint16_t low[BT_ELECTRODES], high[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        low[i] = 1;
        high[i] = 4089;
    }
    for (int k = 0; k < 3; k++) {
        for (int up = 0; up < 2; up++) {
            bt_trigger trigger = rested_trigger(up ? low : high);
            bt_trigger_begin(&trigger, limits[k]);
            (void)bt_trigger_pressure(&trigger, 1, 6);
            uint32_t full = 19u * 4088 * 4088;
            assert_int_equal(round_energy(&trigger, limits[k], up ? high : low), 0);
            (void)bt_trigger_pressure(&trigger, 4089, 6);
            assert_int_equal(round_energy(&trigger, limits[k], up ? high : low), full);
            assert_true(trigger.room < 0);
            assert_true(bt_trigger_pressure(&trigger, 4089, 6) < 0);
            assert_int_equal(bt_trigger_energy(&trigger), full);
        }
    }
}
