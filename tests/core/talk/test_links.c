// Hosts at both of a board's ports: which host may command, which is answered, and which is told of a change.
#include "../fake_host.h"

enum { USB, UART };

static uint32_t now_us;

// Sends to a port; the latest REPLY's error, or OK if another message came. The message is in host.message.
static uint8_t ask(unsigned link, uint8_t id, const void *payload, size_t bytes)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES], error = BT_ERROR_OK;
    host_forget();
    bt_session_receive(&session, link, encoded, bt_frame_encode(id, payload, bytes, encoded), now_us);
    assert_true(host.count > 0);
    const received_message *last = &host.message[host.count - 1];
    assert_int_equal(last->link, link); // whoever asks is answered
    if (last->id == BT_REPLY_ID) {
        error = last->payload[2];
    }
    return error;
}

static uint8_t stream_at(unsigned link, uint16_t keepalive_ms)
{
    uint8_t payload[BT_START_BYTES];
    bt_msg_start msg = {
        .req_id = 9, .streams = BT_STREAM_FLAG_FRAMES, .fingers = 1, .keepalive_ms = keepalive_ms};
    bt_msg_start_pack(&msg, payload);
    return ask(link, BT_START_ID, payload, sizeof payload);
}

static uint8_t take_link_at(unsigned link, uint16_t keepalive_ms)
{
    const uint8_t payload[BT_TAKE_LINK_BYTES] = {7, (uint8_t)keepalive_ms, (uint8_t)(keepalive_ms >> 8)};
    return ask(link, BT_TAKE_LINK_ID, payload, sizeof payload);
}

static uint8_t subscribe_at(unsigned link, uint8_t quantities)
{
    return ask(link, BT_SUBSCRIBE_ID, (const uint8_t[]){6, 0x1F, quantities}, BT_SUBSCRIBE_BYTES);
}

// The ports that got an unrequested STATUS with LINK_TAKEN in the answer to the latest command.
static unsigned links_that_sent(void)
{
    unsigned ports = 0;
    for (int k = 0; k < host.count; k++) {
        bt_msg_status status;
        if (host.message[k].id == BT_STATUS_ID) {
            bt_msg_status_unpack(&status, host.message[k].payload);
            ports |= status.req_id == 0 && status.faults & BT_FAULT_FLAG_LINK_TAKEN
                         ? 1u << host.message[k].link
                         : 0;
        }
    }
    return ports;
}

// The port that FRAMEs go to.
static unsigned frames_go_to(void)
{
    host_forget();
    host_round(&session, 1, 2000);
    assert_true(host.count > 0);
    return host.message[0].link;
}

TEST(who_streams_with_a_keep_alive_keeps_the_link)
{
    assert_int_equal(stream_at(UART, 500), BT_ERROR_OK);
    for (int id = 0x80; id < 0xC0; id++) { // whatever a host may say
        uint8_t payload[BT_FRAME_MAX_BYTES] = {1};
        int bytes = bt_wire_payload_bytes((uint8_t)id);
        bool asks = id == BT_HELLO_REQUEST_ID || id == BT_STOP_ID || id == BT_PING_ID || id == BT_READ_MAP_ID
                    || (id >= BT_GET_STATUS_ID && id <= BT_GET_SENSOR_INFO_ID) || id == BT_GET_POINT_ID
                    || id == BT_GET_BOARD_FACTS_ID || id == BT_GET_SETTING_ID || id == BT_GET_CALIBRATION_ID
                    || id == BT_GET_MAP_ID;
        if (bytes >= 0 && id != BT_TAKE_LINK_ID) {
            uint8_t error = ask(USB, (uint8_t)id, payload, (size_t)bytes);
            assert_int_equal(error == BT_ERROR_LINK_BUSY, !asks);
        }
    }
    assert_int_equal(session.status.streams, BT_STREAM_FLAG_FRAMES);
    assert_int_equal(frames_go_to(), UART);
    // A request of the other host is no sign of life of the first.
    now_us = 500001;
    assert_int_equal(ask(USB, BT_PING_ID, "\1", 1), BT_ERROR_OK);
    bt_session_tick(&session, now_us);
    assert_int_equal(session.status.faults, BT_FAULT_FLAG_HOST_SILENT);
    assert_int_equal(stream_at(USB, 500), BT_ERROR_OK);
    assert_int_equal(links_that_sent(), 0); // no host had the board
    assert_int_equal(frames_go_to(), USB);
    assert_int_equal(stream_at(UART, 500), BT_ERROR_LINK_BUSY);
    bt_session_link_down(&session, USB);
    assert_int_equal(stream_at(UART, 500), BT_ERROR_OK);
}

TEST(a_stream_without_a_keep_alive_is_taken_by_start_and_both_are_told)
{
    assert_int_equal(subscribe_at(USB, BT_QUANTITY_FLAG_EVENTS), BT_ERROR_OK);
    assert_int_equal(stream_at(USB, 0), BT_ERROR_OK);
    assert_int_equal(ask(UART, BT_STOP_ID, "\2", 1), BT_ERROR_OK); // every program begins with it
    assert_int_equal(session.status.streams, BT_STREAM_FLAG_FRAMES);
    assert_int_equal(stream_at(UART, 500), BT_ERROR_OK);
    assert_int_equal(links_that_sent(), 1 << USB | 1 << UART);
    assert_int_equal(frames_go_to(), UART);
    assert_int_equal(session.finger[0].quantities, BT_SUBSCRIBED_AT_FIRST); // not the other host's choice
}

TEST(the_next_program_at_a_port_does_not_inherit_a_subscription)
{
    uint8_t payload[BT_HELLO_REQUEST_BYTES] = {1};
    assert_int_equal(subscribe_at(UART, BT_QUANTITY_FLAG_EVENTS), BT_ERROR_OK);
    assert_int_equal(stream_at(UART, 100), BT_ERROR_OK);
    assert_int_equal(ask(UART, BT_HELLO_REQUEST_ID, payload, sizeof payload), BT_ERROR_OK);
    assert_int_equal(session.finger[0].quantities, BT_QUANTITY_FLAG_EVENTS); // the host's own question
    bt_session_tick(&session, now_us += 100001);
    assert_int_equal(ask(UART, BT_HELLO_REQUEST_ID, payload, sizeof payload), BT_ERROR_OK);
    assert_int_equal(stream_at(UART, 100), BT_ERROR_OK);
    assert_int_equal(session.finger[0].quantities, BT_SUBSCRIBED_AT_FIRST);
}

TEST(the_link_can_be_taken_and_is_kept_until_the_taker_is_silent)
{
    assert_int_equal(stream_at(UART, 500), BT_ERROR_OK);
    assert_int_equal(ask(UART, BT_HOLD_ID, "\3\1", 2), BT_ERROR_OK);
    assert_int_equal(take_link_at(USB, 0), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(take_link_at(USB, 1000), BT_ERROR_OK);
    assert_int_equal(links_that_sent(), 1 << USB | 1 << UART);
    assert_int_equal(session.status.streams, 0);
    assert_true(session.finger[0].tare.held); // the other host's hold stays
    assert_int_equal(stream_at(UART, 500), BT_ERROR_LINK_BUSY);
    assert_int_equal(ask(USB, BT_RELEASE_ID, "\4\1", 2), BT_ERROR_OK);
    bt_session_tick(&session, now_us += 1000001);
    assert_int_equal(session.status.faults & BT_FAULT_FLAG_HOST_SILENT, 0); // no stream ended
    assert_int_equal(stream_at(UART, 500), BT_ERROR_OK);
    assert_int_equal(take_link_at(USB, 1000), BT_ERROR_OK);
    assert_int_equal(ask(USB, BT_STOP_ID, "\2", 1), BT_ERROR_OK); // gives it back
    assert_int_equal(stream_at(UART, 500), BT_ERROR_OK);
}

TEST(a_host_that_only_holds_keeps_the_link_until_its_hold_lapses)
{
    assert_int_equal(ask(UART, BT_HOLD_ID, "\3\1", 2), BT_ERROR_OK);
    assert_int_equal(ask(USB, BT_RELEASE_ID, "\3\1", 2), BT_ERROR_LINK_BUSY);
    for (int k = 0; k < 30; k++) { // a chatty neighbour does not keep a dead controller's hold alive
        now_us += 100000;
        assert_int_equal(ask(USB, BT_PING_ID, "\1", 1), BT_ERROR_OK);
        bt_session_tick(&session, now_us);
    }
    assert_false(session.finger[0].tare.held);
    assert_int_equal(session.status.faults, BT_FAULT_FLAG_HOLD_LAPSED);
    assert_int_equal(ask(USB, BT_RELEASE_ID, "\3\1", 2), BT_ERROR_OK);
}

BEFORE_EACH(at_time_0)
{
    now_us = 0;
}
