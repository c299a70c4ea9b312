// What went wrong stays told until the host clears it.
#include "fake_host.h"

#define FINGER 0

static bt_msg_status status(void)
{
    bt_msg_status msg;
    const received_message *message = host_ask(&session, BT_GET_STATUS_ID, "\x07", 1);
    assert_int_equal(message->id, BT_STATUS_ID);
    bt_msg_status_unpack(&msg, message->payload);
    return msg;
}

static void clear(uint16_t faults, uint32_t finger_faults)
{
    uint8_t payload[BT_CLEAR_FAULTS_BYTES];
    bt_msg_clear_faults msg = {.req_id = 6, .faults = faults, .finger_faults[FINGER] = finger_faults};
    bt_msg_clear_faults_pack(&msg, payload);
    assert_int_equal(host_error(&session, BT_CLEAR_FAULTS_ID, payload, sizeof payload), BT_ERROR_OK);
}

static void one_round_without_an_electrode(void)
{
    bt_session_begin(&session, 0);
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        uint16_t counts[BT_MAX_FINGERS];
        for (int f = 0; f < BT_MAX_FINGERS; f++) {
            bool gone = f != FINGER || bt_slot_channel[slot] == BT_CHANNEL_E1 + 4;
            counts[f] = gone ? BT_INVALID_COUNT : 2000;
        }
        bt_session_slot(&session, slot, counts, 0);
    }
    bt_session_end_round(&session);
}

static void rounds(int n)
{
    for (int k = 0; k < n; k++) {
        host_round(&session, 1 << FINGER, 2000);
    }
}

TEST(a_good_finger_has_none_and_nor_has_one_that_never_was_there)
{
    rounds(300);
    bt_msg_status msg = status();
    assert_int_equal(msg.faults, 0);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        assert_int_equal(msg.finger_faults[f], 0);
    }
}

TEST(a_round_that_lacks_a_word_is_told_until_it_is_cleared)
{
    const uint8_t streams[] = {0, BT_STREAM_FLAG_FRAMES};
    for (int k = 0; k < 2; k++) { // nobody needs to stream for it
        assert_int_equal(start(streams[k], 1 << FINGER, 0), BT_ERROR_OK);
        rounds(100);
        one_round_without_an_electrode();
        rounds(100);
        uint32_t faults = status().finger_faults[FINGER];
        assert_int_equal(faults, BT_FRAME_FLAG_ELECTRODE_MISSING | BT_FRAME_FLAG_ELECTRODE_OUT);
        clear(0, BT_FRAME_FLAG_RAIL); // another
        assert_int_equal(status().finger_faults[FINGER], faults);
        clear(0, faults);
        rounds(10);
        assert_int_equal(status().finger_faults[FINGER], 0);
    }
}

TEST(what_came_after_the_host_looked_stays)
{
    rounds(100);
    uint32_t before = status().finger_faults[FINGER];
    one_round_without_an_electrode();
    clear(UINT16_MAX, before);
    assert_int_equal(status().finger_faults[FINGER],
                     BT_FRAME_FLAG_ELECTRODE_MISSING | BT_FRAME_FLAG_ELECTRODE_OUT);
}

TEST(what_goes_on_is_set_again)
{
    rounds(100);
    host_round(&session, 0, 0); // away: one round of silence is enough to doubt who is there
    assert_true(status().finger_faults[FINGER] & BT_FRAME_FLAG_SENSOR_UNSURE);
    clear(0, UINT32_MAX);
    host_round(&session, 0, 0);
    assert_true(status().finger_faults[FINGER] & BT_FRAME_FLAG_SENSOR_UNSURE);
}

TEST(a_tare_that_is_lost_is_one_but_none_yet_is_not)
{
    rounds(3);
    assert_int_equal(session.finger[FINGER].tare.tared, false);
    assert_int_equal(status().finger_faults[FINGER], 0);
    rounds(300);
    assert_int_equal(session.finger[FINGER].tare.tared, true);
    session.finger[FINGER].tare.tared = false; // as inverted signals do
    session.finger[FINGER].tare.reason = BT_TARE_REASON_INVERTED;
    rounds(1);
    assert_int_equal(status().finger_faults[FINGER], BT_FRAME_FLAG_UNTARED);
}

TEST(the_link_and_the_host_have_faults_of_their_own)
{
    uint8_t garbage[] = {7, 1, 2, 3, 4, 5, 6, 0};
    bt_session_receive(&session, 0, garbage, sizeof garbage, 0);
    uint16_t faults = BT_FAULT_FLAG_LINK_DAMAGED; // none goes when another comes
    assert_int_equal(status().faults, faults);

    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << FINGER, 100), BT_ERROR_OK);
    bt_session_tick(&session, 100001);
    faults |= BT_FAULT_FLAG_HOST_SILENT;
    assert_int_equal(status().faults, faults);

    assert_int_equal(host_error(&session, BT_HOLD_ID, (uint8_t[]){9, 1 << FINGER}, 2), BT_ERROR_OK);
    bt_session_tick(&session, 2000001);
    faults |= BT_FAULT_FLAG_HOLD_LAPSED;
    assert_int_equal(status().faults, faults);

    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << FINGER, 0), BT_ERROR_OK);
    host.room = 0;
    rounds(1);
    host.room = SIZE_MAX;
    assert_int_equal(status().faults, faults | BT_FAULT_FLAG_DROPPED);
    clear(UINT16_MAX, 0);
    assert_int_equal(status().faults, 0);
}

int main(void)
{
    return run_all(NULL, new_session);
}
