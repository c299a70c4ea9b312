// The point inside a round: the same bits as the kernel's from the same signals, and the words of the slots
// that have come.
#include "fake_host.h"

#include "running.h"

static uint64_t seed = 7;

static int32_t any_signal(int kind)
{
    static const int32_t corners[] = {0, 1, -1, 65520, -65520};
    switch (kind % 3) {
    case 0:
        return (int32_t)random_range(&seed, -65520, 65520);
    case 1:
        return (int32_t)random_range(&seed, -300, 300);
    default:
        return corners[random_range(&seed, 0, 4)];
    }
}

static void any_order_of_changes_gives_the_bits_of_the_whole(void **state)
{
    (void)state;
    bt_running running;
    bt_running_reset(&running);
    int32_t e_q4[BT_ELECTRODES] = {0};
    for (int k = 0; k < 300000; k++) {
        unsigned i = (unsigned)random_range(&seed, 0, BT_ELECTRODES - 1);
        e_q4[i] = any_signal(k / 1000);
        bt_running_put(&running, i, e_q4[i]);
        int weights = k % 3;
        bt_point piecewise = {{1, 2, 3}, {4, 5}};
        bt_point whole = piecewise;
        assert_int_equal(bt_running_point(&running, weights, &piecewise), bt_poc(e_q4, weights, &whole));
        assert_memory_equal(&piecewise, &whole, sizeof whole);
    }
}

static bt_msg_point ask(void)
{
    bt_msg_point point;
    const received_message *message = host_ask(&session, BT_GET_POINT_ID, "\x05\x00", 2);
    assert_int_equal(message->id, BT_POINT_ID);
    bt_msg_point_unpack(&point, message->payload);
    return point;
}

static void a_touch_shows_as_soon_as_its_electrodes_slots_have_passed(void **state)
{
    (void)state;
    uint16_t counts[BT_MAX_FINGERS] = {3000, BT_INVALID_COUNT, BT_INVALID_COUNT, BT_INVALID_COUNT,
                                       BT_INVALID_COUNT};
    host_round(&session, 1, 3000);
    assert_int_equal(ask().poc_um[0], BT_INVALID_I16); // no tare yet
    for (int k = 0; k < 50; k++) {
        host_round(&session, 1, 3000);
    }
    bt_msg_point before = ask();
    assert_int_equal(before.poc_um[0], BT_INVALID_I16); // tared, nothing weighs
    assert_int_equal(before.slot, 0);                   // of the round that comes
    // A touch on E3 alone begins in this round: before its slot nothing, after it E3's own projection.
    int32_t e_q4[BT_ELECTRODES] = {0};
    bt_point want;
    e_q4[2] = -16 * 500;
    assert_true(bt_poc(e_q4, BT_POC_WEIGHTS_COMPRESS_N1, &want));
    bt_session_begin(&session, 0);
    for (uint8_t slot = 0; slot < 16; slot++) {
        counts[0] = slot == 11 ? 2500 : 3000; // PAC PDC PAC TAC PAC TDC PAC E1 PAC E2 PAC E3
        bt_session_slot(&session, slot, counts, 0);
        bt_msg_point now = ask();
        assert_int_equal(now.slot, slot + 1);
        assert_int_equal(now.seq, before.seq);
        for (int d = 0; d < 3; d++) {
            assert_int_equal(now.poc_um[d], slot < 11 ? BT_INVALID_I16 : want.um[d]);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_order_of_changes_gives_the_bits_of_the_whole),
        cmocka_unit_test_setup(a_touch_shows_as_soon_as_its_electrodes_slots_have_passed, new_session),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
