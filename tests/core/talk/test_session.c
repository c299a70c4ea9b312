// The conversation: every command gets exactly one reply, and what cannot be done is refused by name.
#include "fake_board.h"
#include "fake_host.h"

#define OF_THE_SENSOR_BOARD 0xC0 // and above: commands that a gateway does not know, see link.toml

// SPEC.md, Commands. FINGER: it names one. STOPPED: not while streaming.
enum { FINGER = 1, STOPPED = 2 };

static const struct {
    uint8_t id, answer, checks;
} commands[] = {
    {BT_HELLO_REQUEST_ID, BT_HELLO_ID, 0},
    {BT_START_ID, BT_REPLY_ID, 0},
    {BT_STOP_ID, BT_REPLY_ID, 0},
    {BT_PING_ID, BT_REPLY_ID, 0},
    {BT_TARE_NOW_ID, BT_REPLY_ID, FINGER},
    {BT_TARE_SET_ID, BT_REPLY_ID, FINGER},
    {BT_GET_STATUS_ID, BT_STATUS_ID, 0},
    {BT_GET_SENSOR_STATUS_ID, BT_SENSOR_STATUS_ID, FINGER},
    {BT_GET_SENSOR_INFO_ID, BT_SENSOR_INFO_ID, FINGER},
    {BT_GET_SETTING_ID, BT_SETTING_ID, 0},
    {BT_SET_SETTING_ID, BT_SETTING_ID, STOPPED},
    {BT_SUBSCRIBE_ID, BT_REPLY_ID, 0},
    {BT_GET_POINT_ID, BT_POINT_ID, FINGER},
    {BT_REBOOT_BOOTLOADER_ID, BT_REPLY_ID, 0},
    {BT_SAVE_SETTINGS_ID, BT_REPLY_ID, STOPPED},
    {BT_GET_CALIBRATION_ID, BT_CALIBRATION_ID, FINGER},
    {BT_SET_CALIBRATION_ID, BT_CALIBRATION_ID, FINGER | STOPPED},
    {BT_CLEAR_CALIBRATION_ID, BT_REPLY_ID, FINGER | STOPPED},
    {BT_GET_MAP_ID, BT_MAP_INFO_ID, FINGER},
    {BT_READ_MAP_ID, BT_REPLY_ID, FINGER}, // there is none
    {BT_BEGIN_MAP_ID, BT_REPLY_ID, FINGER | STOPPED},
    {BT_WRITE_MAP_ID, BT_REPLY_ID, FINGER | STOPPED},
    {BT_END_MAP_ID, BT_REPLY_ID, FINGER | STOPPED},
    {BT_CLEAR_MAP_ID, BT_REPLY_ID, FINGER | STOPPED},
    {BT_HOLD_ID, BT_REPLY_ID, 0},
    {BT_RELEASE_ID, BT_REPLY_ID, 0},
    {BT_CLEAR_FAULTS_ID, BT_REPLY_ID, 0},
    {BT_GET_BOARD_FACTS_ID, BT_REPLY_ID, 0}, // this board measures nothing
    {BT_SET_BUS_RATE_ID, BT_REPLY_ID, STOPPED},
    {BT_TAKE_LINK_ID, BT_REPLY_ID, 0},
};
#define COMMANDS (sizeof commands / sizeof *commands)

// The answer to the k-th, with k for its req_id. `second`: the byte behind it, which is a finger's or a
// setting's.
static const received_message *ask(size_t k, uint8_t second)
{
    const uint8_t payload[BT_FRAME_MAX_BYTES] = {(uint8_t)k, second};
    return host_ask(&session, commands[k].id, payload, (size_t)bt_wire_payload_bytes(commands[k].id));
}

// Of a REPLY to the k-th; OK for any other message.
static uint8_t error_of(size_t k, uint8_t second)
{
    const received_message *message = ask(k, second);
    return message->id == BT_REPLY_ID ? message->payload[2] : (uint8_t)BT_ERROR_OK;
}

TEST(hello_tells_who_is_there_and_echoes_the_nonce)
{
    uint8_t payload[BT_HELLO_REQUEST_BYTES];
    bt_msg_hello_request request = {.req_id = 200, .nonce = 0xCAFEBABE};
    bt_msg_hello hello;
    host_round(&session, 1 << 1 | 1 << 4, 2000);
    bt_msg_hello_request_pack(&request, payload);
    const received_message *message = host_ask(&session, BT_HELLO_REQUEST_ID, payload, sizeof payload);
    assert_int_equal(message->id, BT_HELLO_ID);
    bt_msg_hello_unpack(&hello, message->payload);
    assert_true(hello.req_id == 200 && hello.nonce == 0xCAFEBABE);
    assert_true(hello.wire_major == BT_WIRE_MAJOR && hello.wire_minor == BT_WIRE_MINOR);
    assert_int_equal(hello.schema_hash, BT_SCHEMA_HASH);
    assert_true(hello.firmware_major == 1 && hello.firmware_minor == 2 && hello.firmware_patch == 3);
    assert_true(hello.board == BT_BOARD_PICO && hello.boot_id == 0xB0071D);
    assert_memory_equal(hello.board_serial, "ABCDEFGHIJKL", 12);
    assert_int_equal(hello.slot_hz, 4400);
    assert_int_equal(hello.fingers_present, 1 << 1 | 1 << 4);
}

// Two fingers, and no place for maps: what is kept is refused, what is asked is answered.
TEST(a_board_tells_what_it_can_and_refuses_the_rest)
{
    static const bt_board_actions no_maps = {.save_map = NULL};
    uint8_t payload[BT_HELLO_REQUEST_BYTES] = {1};
    bt_msg_hello hello;
    session.identity.fingers = 2;
    memcpy(session.identity.board_name, "little one", 11);
    bt_session_use_board(&session, &no_maps);
    bt_msg_hello_unpack(&hello, host_ask(&session, BT_HELLO_REQUEST_ID, payload, sizeof payload)->payload);
    assert_true(hello.fingers == 2 && hello.map_bytes == 0);
    assert_memory_equal(hello.board_name, "little one", sizeof "little one");
    for (uint8_t finger = 0; finger < BT_MAX_FINGERS; finger++) {
        const uint8_t one[BT_BEGIN_MAP_BYTES] = {3, finger};
        assert_int_equal(host_ask(&session, BT_GET_SENSOR_INFO_ID, one, 2)->id, BT_SENSOR_INFO_ID);
        assert_int_equal(host_ask(&session, BT_GET_MAP_ID, one, 2)->id, BT_MAP_INFO_ID);
        assert_int_equal(host_error(&session, BT_CLEAR_CALIBRATION_ID, one, 2),
                         finger < 2 ? BT_ERROR_OK : BT_ERROR_NO_SUCH_FINGER);
        assert_int_equal(host_error(&session, BT_BEGIN_MAP_ID, one, sizeof one),
                         finger < 2 ? BT_ERROR_NOT_HERE : BT_ERROR_NO_SUCH_FINGER);
    }
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 0x1F, 0), BT_ERROR_OK); // who is not there is silent
}

TEST(every_command_gets_exactly_one_reply_with_its_req_id)
{
    for (int id = 0x80; id < OF_THE_SENSOR_BOARD; id++) { // the table holds every command there is
        int listed = 0;
        for (size_t k = 0; k < COMMANDS; k++) {
            listed += commands[k].id == id;
        }
        assert_int_equal(listed, bt_wire_payload_bytes((uint8_t)id) >= 0);
    }
    host_round(&session, 1, 2000); // GET_POINT wants a sensor that answers
    for (size_t k = 0; k < COMMANDS; k++) {
        bool setting = commands[k].id == BT_GET_SETTING_ID || commands[k].id == BT_SET_SETTING_ID;
        const received_message *message = ask(k, setting ? BT_SETTING_POC_WEIGHTS : 0);
        bool numbered =
            message->id == BT_STATUS_ID || message->id == BT_SENSOR_STATUS_ID; // seq and t_us first
        assert_int_equal(message->id, commands[k].answer);
        assert_int_equal(message->payload[numbered ? 6 : 0], k);
    }
}

TEST(a_finger_that_no_board_has_is_refused_and_so_is_what_would_change_a_stream)
{
    for (size_t k = 0; k < COMMANDS; k++) {
        if (commands[k].checks & FINGER) {
            assert_int_equal(error_of(k, BT_MAX_FINGERS), BT_ERROR_NO_SUCH_FINGER);
        }
        assert_int_equal(start(BT_STREAM_FLAG_PAC, 1, 0), BT_ERROR_OK);
        assert_int_equal(error_of(k, 0) == BT_ERROR_BUSY, (commands[k].checks & STOPPED) != 0);
    }
}

TEST(errors_are_told_by_name)
{
    static const uint8_t absent[2] = {1, 2}, no_setting[2] = {1, 99};
    uint8_t tare[BT_TARE_SET_BYTES] = {1, 0};
    assert_int_equal(host_error(&session, BT_TARE_NOW_ID, absent, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_POINT_ID, absent, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_SETTING_ID, no_setting, 2), BT_ERROR_UNKNOWN_SETTING);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 5, 0), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_HOLD_ID, "\1\x20", 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(session.streams, 0);

    tare[2 + 18] = 0xF1; // electrode 9 at 65521 sixteenths
    tare[2 + 19] = 0xFF;
    assert_int_equal(host_error(&session, BT_TARE_SET_ID, tare, sizeof tare), BT_ERROR_OUT_OF_RANGE);
    tare[2 + 18] = 0xF0;
    tare[2 + 38] = 0xFE; // pressure: 65534 is no count, 65535 means unknown
    tare[2 + 39] = 0xFF;
    assert_int_equal(host_error(&session, BT_TARE_SET_ID, tare, sizeof tare), BT_ERROR_OUT_OF_RANGE);
    tare[2 + 38] = 0xFF;
    assert_int_equal(host_error(&session, BT_TARE_SET_ID, tare, sizeof tare), BT_ERROR_OK);

    host_round(&session, 1 << 2, 2000);
    assert_int_equal(host_error(&session, BT_TARE_NOW_ID, absent, 2), BT_ERROR_NOT_STILL);
    host_round(&session, 1 << 2, 4095);
    assert_int_equal(host_error(&session, BT_TARE_NOW_ID, absent, 2), BT_ERROR_RAILED);
}

TEST(unknown_commands_are_answered_as_such)
{
    for (int id = 0x80; id < 0x100; id++) {
        int bytes = bt_wire_payload_bytes((uint8_t)id);
        if (bytes < 0 || id >= OF_THE_SENSOR_BOARD) {
            uint8_t payload[BT_FRAME_MAX_BYTES] = {0x21};
            assert_int_equal(host_error(&session, (uint8_t)id, payload, bytes < 0 ? 3 : (size_t)bytes),
                             BT_ERROR_UNKNOWN_COMMAND);
        }
    }
    const received_message *message = host_ask(&session, 0xF0, "", 0); // and without a payload, of no request
    assert_int_equal(message->id, BT_REPLY_ID);
    assert_memory_equal(message->payload, ((uint8_t[]){0, 0xF0, BT_ERROR_UNKNOWN_COMMAND}), 3);
}

TEST(a_wrong_length_is_answered_and_does_nothing)
{
    static const uint8_t zeros[BT_FRAME_MAX_BYTES];
    for (int id = 0x80; id < 0x100; id++) {
        int right = bt_wire_payload_bytes((uint8_t)id);
        for (int bytes = 0; right >= 0 && bytes < 60; bytes++) {
            if (bytes != right) {
                assert_int_equal(host_error(&session, (uint8_t)id, zeros, (size_t)bytes),
                                 BT_ERROR_BAD_LENGTH);
            }
        }
    }
    assert_int_equal(session.rx_frames, 0);
    assert_true(session.rx_errors > 0);
}

TEST(an_echo_of_our_own_messages_is_not_answered)
{
    uint8_t payload[BT_FRAME_MAX_BYTES] = {1};
    for (int id = 0; id < 0x80; id++) {
        int bytes = bt_wire_payload_bytes((uint8_t)id);
        host_send(&session, (uint8_t)id, payload, bytes < 0 ? 3 : (size_t)bytes, 0);
        host_send(&session, (uint8_t)id, payload, bytes < 0 ? 0 : (size_t)bytes - 1, 0);
    }
    assert_int_equal(host.count, 0);
}

int main(void)
{
    return run_all(NULL, new_session);
}
