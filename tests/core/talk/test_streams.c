// What a session sends unasked: streams, whole or not at all, and what stops them.
#include "fake_host.h"

TEST(only_what_was_asked_for_is_streamed)
{
    for (uint8_t streams = 0; streams <= BT_STREAM_FLAGS; streams++) {
        assert_int_equal(start(streams, 1 << 0 | 1 << 3, 0), BT_ERROR_OK);
        host_forget();
        for (int k = 0; k < 20; k++) {
            host_round(&session, 1 << 0 | 1 << 1 | 1 << 3, 2000); // finger 1 answers, nobody asked
        }
        assert_int_equal(host_count(BT_FRAME_ID), (streams & BT_STREAM_FLAG_FRAMES) != 0 ? 40 : 0);
        assert_int_equal(host_count(BT_PAC_ID), (streams & BT_STREAM_FLAG_PAC) != 0 ? 40 : 0);
        assert_int_equal(host_count(BT_BANDS_ID), (streams & BT_STREAM_FLAG_BANDS) != 0 ? 40 : 0);
        for (int k = 0; k < host.count; k++) {
            uint8_t finger = host.message[k].payload[6];
            assert_true(finger == 0 || finger == 3);
        }
    }
    assert_int_equal(stop(), BT_ERROR_OK);
    host_forget();
    host_round(&session, 0x1F, 2000);
    assert_int_equal(host.count, 0);
}

TEST(the_keep_alive_stops_the_stream_and_any_good_frame_keeps_it)
{
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 1500), BT_ERROR_OK);
    bt_session_tick(&session, 1500000);
    assert_int_equal(session.streams, BT_STREAM_FLAG_FRAMES);
    host_send(&session, BT_PING_ID, "\x01", 1, 1500000);
    bt_session_tick(&session, 3000000);
    assert_int_equal(session.streams, BT_STREAM_FLAG_FRAMES);
    bt_session_receive(&session, 0, (const uint8_t *)"noise\0", 6, 2900000); // says nothing
    bt_session_tick(&session, 3000001);
    assert_int_equal(session.streams, 0);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK); // 0: never
    for (uint32_t s = 0; s < 4000; s++) {
        bt_session_tick(&session, s * 1000000);
    }
    assert_int_equal(session.streams, BT_STREAM_FLAG_FRAMES);
}

TEST(the_keep_alive_holds_across_the_wrap_of_time)
{
    uint8_t payload[BT_START_BYTES] = {1, BT_STREAM_FLAG_FRAMES, 1, 0xE8, 0x03};
    bt_session_tick(&session, UINT32_MAX - 200000);
    host_send(&session, BT_START_ID, payload, sizeof payload, UINT32_MAX - 200000);
    bt_session_tick(&session, 790000);
    assert_int_equal(session.streams, BT_STREAM_FLAG_FRAMES);
    bt_session_tick(&session, 810000);
    assert_int_equal(session.streams, 0);
}

TEST(uptime_does_not_wrap_with_the_clock)
{
    bt_msg_status status;
    for (uint64_t s = 1; s <= 3 * 3600; s++) {
        bt_session_tick(&session, (uint32_t)(s * 1000000)); // wraps after 71 minutes
    }
    bt_msg_status_unpack(&status, host_ask(&session, BT_GET_STATUS_ID, "\x04", 1)->payload);
    assert_int_equal(status.uptime_s, 3 * 3600);
}

TEST(status_comes_in_its_period_and_with_every_present_sensor)
{
    host_round(&session, 1 << 0 | 1 << 2, 2000);
    assert_int_equal(start(BT_STREAM_FLAG_STATUS, 0, 0), BT_ERROR_OK);
    host_forget();
    for (uint32_t ms = 1; ms <= 10000; ms++) {
        bt_session_tick(&session, ms * 1000);
    }
    assert_int_equal(host_count(BT_STATUS_ID), 10);
    assert_int_equal(host_count(BT_SENSOR_STATUS_ID), 20);
    int seq = -1;
    for (int k = 0; k < host.count; k++) {
        bt_msg_status status;
        bt_msg_sensor_status of_sensor;
        if (host.message[k].id == BT_STATUS_ID) {
            bt_msg_status_unpack(&status, host.message[k].payload);
            assert_int_equal(status.req_id, 0);
            assert_true(seq < 0 || status.seq == seq + 1);
            seq = status.seq;
        } else {
            bt_msg_sensor_status_unpack(&of_sensor, host.message[k].payload);
            assert_true(of_sensor.req_id == 0 && of_sensor.finger == 2 * (k % 3 - 1)); // behind the STATUS
        }
    }
}

TEST(frames_that_find_no_room_are_dropped_whole_and_counted)
{
    bt_msg_status status;
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES | BT_STREAM_FLAG_PAC, 0x1F, 0), BT_ERROR_OK);
    uint32_t sent = session.messages_sent;
    host_forget();
    for (size_t room = 0; room < 1500; room += 7) { // every remainder of a frame's length
        host.room = room;
        host_round(&session, 0x1F, 2000);
    }
    host.room = SIZE_MAX;
    assert_false(host.broken);
    assert_int_equal(session.messages_sent - sent, host.count);
    assert_true(session.messages_dropped > 0 && host.count > 0);
    uint32_t dropped = session.messages_dropped;
    bt_msg_status_unpack(&status, host_ask(&session, BT_GET_STATUS_ID, "\x04", 1)->payload);
    assert_int_equal(status.messages_dropped, dropped);
    // What was made is numbered, sent or not: the gap shows the loss.
    host_round(&session, 1, 2000);
    bt_msg_frame frame;
    bt_msg_frame_unpack(&frame, host.message[1].payload);
    assert_int_equal(host.message[1].id, BT_FRAME_ID);
    assert_int_equal(frame.seq, (1500 + 6) / 7);
}

TEST(a_closed_port_ends_the_stream_and_half_a_command)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES];
    size_t bytes = bt_frame_encode(BT_PING_ID, (const uint8_t *)"\x31", 1, encoded);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
    bt_session_receive(&session, 0, encoded, 3, 0);
    bt_session_link_down(&session, 0);
    host_forget();
    host_round(&session, 1, 2000);
    assert_int_equal(host.count, 0);
    assert_int_equal(session.streams, 0);
    bt_session_receive(&session, 0, encoded, bytes, 0); // the next host's first frame is whole
    assert_int_equal(host.count, 1);
    assert_int_equal(host.message[0].payload[0], 0x31);
}

int main(void)
{
    return run_all(NULL, new_session);
}
