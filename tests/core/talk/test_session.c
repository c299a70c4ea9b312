// The conversation: every command gets exactly one reply.
#include "fake_board.h"
#include "fake_host.h"

#define OF_THE_SENSOR_BOARD 0xC0 // and above: commands that a gateway does not know, see link.toml

static const received_message *set(uint8_t setting, int32_t value)
{
    uint8_t payload[BT_SET_SETTING_BYTES];
    bt_msg_set_setting msg = {.req_id = 77, .setting = setting, .value = value};
    bt_msg_set_setting_pack(&msg, payload);
    return host_ask(&session, BT_SET_SETTING_ID, payload, sizeof payload);
}

static uint8_t set_error(uint8_t setting, int32_t value)
{
    const received_message *message = set(setting, value);
    bt_msg_reply reply;
    if (message->id == BT_SETTING_ID) {
        return BT_ERROR_OK;
    }
    assert_int_equal(message->id, BT_REPLY_ID);
    bt_msg_reply_unpack(&reply, message->payload);
    assert_int_equal(reply.command, BT_SET_SETTING_ID);
    assert_int_equal(reply.req_id, 77);
    return reply.error;
}

static int32_t get(uint8_t setting)
{
    uint8_t payload[2] = {5, setting};
    const received_message *message = host_ask(&session, BT_GET_SETTING_ID, payload, 2);
    bt_msg_setting value;
    assert_int_equal(message->id, BT_SETTING_ID);
    bt_msg_setting_unpack(&value, message->payload);
    assert_true(value.req_id == 5 && value.setting == setting);
    return value.value;
}

static void hello_tells_who_is_there_and_echoes_the_nonce(void **state)
{
    (void)state;
    uint8_t payload[BT_HELLO_REQUEST_BYTES];
    bt_msg_hello_request request = {.req_id = 200, .nonce = 0xCAFEBABE};
    bt_msg_hello hello;
    host_round(&session, 1 << 1 | 1 << 4, 2000);
    bt_msg_hello_request_pack(&request, payload);
    const received_message *message = host_ask(&session, BT_HELLO_REQUEST_ID, payload, sizeof payload);
    assert_int_equal(message->id, BT_HELLO_ID);
    bt_msg_hello_unpack(&hello, message->payload);
    assert_int_equal(hello.req_id, 200);
    assert_int_equal(hello.nonce, 0xCAFEBABE);
    assert_int_equal(hello.wire_major, BT_WIRE_MAJOR);
    assert_int_equal(hello.wire_minor, BT_WIRE_MINOR);
    assert_int_equal(hello.schema_hash, BT_SCHEMA_HASH);
    assert_true(hello.firmware_major == 1 && hello.firmware_minor == 2 && hello.firmware_patch == 3);
    assert_int_equal(hello.board, BT_BOARD_PICO);
    assert_int_equal(hello.boot_id, 0xB0071D);
    assert_memory_equal(hello.board_serial, "ABCDEFGHIJKL", 12);
    assert_int_equal(hello.slot_hz, 4400);
    assert_int_equal(hello.fingers_present, 1 << 1 | 1 << 4);
}

// Two fingers, and no place for maps: what is kept is refused, what is asked is answered.
static void a_board_tells_what_it_can_and_refuses_the_rest(void **state)
{
    (void)state;
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
        uint8_t one[2] = {3, finger};
        bt_msg_begin_map map = {.req_id = 3, .finger = finger, .size_bytes = 100};
        uint8_t begin[BT_BEGIN_MAP_BYTES];
        bt_msg_begin_map_pack(&map, begin);
        assert_int_equal(host_ask(&session, BT_GET_SENSOR_INFO_ID, one, 2)->id, BT_SENSOR_INFO_ID);
        assert_int_equal(host_ask(&session, BT_GET_MAP_ID, one, 2)->id, BT_MAP_INFO_ID);
        assert_int_equal(host_error(&session, BT_CLEAR_CALIBRATION_ID, one, 2),
                         finger < 2 ? BT_ERROR_OK : BT_ERROR_NO_SUCH_FINGER);
        assert_int_equal(host_error(&session, BT_BEGIN_MAP_ID, begin, sizeof begin),
                         finger < 2 ? BT_ERROR_NOT_HERE : BT_ERROR_NO_SUCH_FINGER);
    }
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 0x1F, 0),
                     BT_ERROR_OK); // those that are not there are silent
}

static void every_command_gets_exactly_one_reply_with_its_req_id(void **state)
{
    (void)state;
    static const struct {
        uint8_t id, answer, req_id_at, req_id;
    } table[] = {
        {BT_HELLO_REQUEST_ID, BT_HELLO_ID, 0, 11},
        {BT_START_ID, BT_REPLY_ID, 0, 12},
        {BT_STOP_ID, BT_REPLY_ID, 0, 13},
        {BT_PING_ID, BT_REPLY_ID, 0, 14},
        {BT_TARE_NOW_ID, BT_REPLY_ID, 0, 15},
        {BT_TARE_SET_ID, BT_REPLY_ID, 0, 16},
        {BT_GET_STATUS_ID, BT_STATUS_ID, 6, 17},
        {BT_GET_SENSOR_STATUS_ID, BT_SENSOR_STATUS_ID, 6, 18},
        {BT_GET_SENSOR_INFO_ID, BT_SENSOR_INFO_ID, 0, 19},
        {BT_GET_SETTING_ID, BT_SETTING_ID, 0, 20},
        {BT_SET_SETTING_ID, BT_SETTING_ID, 0, 21},
        {BT_SUBSCRIBE_ID, BT_REPLY_ID, 0, 22},
        {BT_GET_POINT_ID, BT_POINT_ID, 0, 23},
        {BT_REBOOT_BOOTLOADER_ID, BT_REPLY_ID, 0, 24},
        {BT_SAVE_SETTINGS_ID, BT_REPLY_ID, 0, 25},
        {BT_GET_CALIBRATION_ID, BT_CALIBRATION_ID, 0, 26},
        {BT_SET_CALIBRATION_ID, BT_CALIBRATION_ID, 0, 27},
        {BT_CLEAR_CALIBRATION_ID, BT_REPLY_ID, 0, 28},
        {BT_GET_MAP_ID, BT_MAP_INFO_ID, 0, 29},
        {BT_READ_MAP_ID, BT_REPLY_ID, 0, 30}, // there is none
        {BT_BEGIN_MAP_ID, BT_REPLY_ID, 0, 31},
        {BT_WRITE_MAP_ID, BT_REPLY_ID, 0, 32},
        {BT_END_MAP_ID, BT_REPLY_ID, 0, 33},
        {BT_CLEAR_MAP_ID, BT_REPLY_ID, 0, 34},
        {BT_HOLD_ID, BT_REPLY_ID, 0, 35},
        {BT_RELEASE_ID, BT_REPLY_ID, 0, 36},
        {BT_CLEAR_FAULTS_ID, BT_REPLY_ID, 0, 37},
        {BT_GET_BOARD_FACTS_ID, BT_REPLY_ID, 0, 38}, // this board measures nothing
        {BT_SET_BUS_RATE_ID, BT_REPLY_ID, 0, 39},
        {BT_TAKE_LINK_ID, BT_REPLY_ID, 0, 40},
    };
    for (int id = 0x80; id < OF_THE_SENSOR_BOARD; id++) { // the table holds every command there is
        int listed = 0;
        for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
            listed += table[k].id == id;
        }
        assert_int_equal(listed, bt_wire_payload_bytes((uint8_t)id) >= 0);
    }
    host_round(&session, 1, 2000); // GET_POINT wants a sensor that answers
    for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
        uint8_t payload[BT_FRAME_MAX_BYTES] = {table[k].req_id};
        if (table[k].id == BT_GET_SETTING_ID || table[k].id == BT_SET_SETTING_ID) {
            payload[1] = BT_SETTING_POC_WEIGHTS;
        }
        const received_message *message =
            host_ask(&session, table[k].id, payload, (size_t)bt_wire_payload_bytes(table[k].id));
        assert_int_equal(message->id, table[k].answer);
        assert_int_equal(message->payload[table[k].req_id_at], table[k].req_id);
    }
}

static void errors_are_told_by_name(void **state)
{
    (void)state;
    static const uint8_t absent[2] = {1, 2}, beyond[2] = {1, 5}, no_setting[2] = {1, 99};
    uint8_t tare[BT_TARE_SET_BYTES] = {1, 0};
    assert_int_equal(host_error(&session, BT_TARE_NOW_ID, absent, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_TARE_NOW_ID, beyond, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_POINT_ID, absent, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_POINT_ID, beyond, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_SENSOR_STATUS_ID, beyond, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_SENSOR_INFO_ID, beyond, 2), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(host_error(&session, BT_GET_SETTING_ID, no_setting, 2), BT_ERROR_UNKNOWN_SETTING);
    assert_int_equal(set_error(0, 1), BT_ERROR_UNKNOWN_SETTING);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 5, 0), BT_ERROR_NO_SUCH_FINGER);
    assert_int_equal(session.streams, 0);

    tare[1] = 5;
    assert_int_equal(host_error(&session, BT_TARE_SET_ID, tare, sizeof tare), BT_ERROR_NO_SUCH_FINGER);
    tare[1] = 0;
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

static bt_settings saved;
static int saves, reboots;

static uint8_t save(void *context, const bt_settings *settings)
{
    (void)context;
    saved = *settings;
    saves++;
    return BT_ERROR_OK;
}

static int into_bootloader;

static uint8_t reboot(void *context, bool bootloader)
{
    (void)context;
    reboots++;
    into_bootloader = bootloader;
    return BT_ERROR_OK;
}

static uint16_t bus_khz = 4464;

static void set_bus_rate(void *context, uint16_t khz)
{
    (void)context;
    bus_khz = khz == 0 ? 4464 : khz;
}

static void measure(void *context, bt_msg_board_facts *facts)
{
    (void)context;
    facts->bus_khz = bus_khz;
}

static const uint8_t at_6_mhz[BT_SET_BUS_RATE_BYTES] = {1, 6000 & 0xFF, 6000 >> 8};

static uint8_t bus_error(void)
{
    return host_error(&session, BT_SET_BUS_RATE_ID, at_6_mhz, sizeof at_6_mhz);
}

// A rate that is only a trial must not outlive whoever tries it: words would come damaged, with good parity
// some.
static void a_bus_rate_on_trial_ends_with_start_stop_and_a_closed_port(void **state)
{
    (void)state;
    static const uint8_t req_id = 9;
    static const bt_board_actions actions = {.measure = measure, .set_bus_rate = set_bus_rate};
    assert_int_equal(bus_error(), BT_ERROR_NOT_HERE);
    bt_session_use_board(&session, &actions);
    for (int way = 0; way < 3; way++) {
        const received_message *answer = host_ask(&session, BT_SET_BUS_RATE_ID, at_6_mhz, sizeof at_6_mhz);
        assert_true(bus_khz == 6000 && answer->id == BT_BOARD_FACTS_ID);
        if (way == 0) {
            assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
            assert_int_equal(bus_khz, 4464);
            assert_int_equal(bus_error(), BT_ERROR_BUSY);
            assert_int_equal(host_error(&session, BT_STOP_ID, &req_id, 1), BT_ERROR_OK);
        } else if (way == 1) {
            assert_int_equal(host_error(&session, BT_STOP_ID, &req_id, 1), BT_ERROR_OK);
        } else {
            bt_session_link_down(&session, 0);
        }
        assert_int_equal(bus_khz, 4464);
    }
}

static uint8_t reboot_error(uint32_t magic)
{
    uint8_t payload[BT_REBOOT_BOOTLOADER_BYTES];
    bt_msg_reboot_bootloader msg = {.req_id = 1, .magic = magic};
    bt_msg_reboot_bootloader_pack(&msg, payload);
    return host_error(&session, BT_REBOOT_BOOTLOADER_ID, payload, sizeof payload);
}

static void saving_and_leaving_are_the_boards_to_do(void **state)
{
    (void)state;
    static const uint8_t req_id = 9;
    static const bt_board_actions actions = {
        .save_settings = save,
        .save_calibration = keep_calibration,
        .save_map = keep_no_map,
        .reboot = reboot,
    };
    assert_int_equal(host_error(&session, BT_SAVE_SETTINGS_ID, &req_id, 1), BT_ERROR_NOT_HERE);
    assert_int_equal(reboot_error(0xB0071DE5), BT_ERROR_NOT_HERE);
    bt_session_use_board(&session, &actions);
    saves = reboots = 0;
    assert_int_equal(set_error(BT_SETTING_IDLE_PERIOD_MS, 250), BT_ERROR_OK);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
    assert_int_equal(host_error(&session, BT_SAVE_SETTINGS_ID, &req_id, 1), BT_ERROR_BUSY);
    assert_int_equal(saves, 0);
    assert_int_equal(host_error(&session, BT_STOP_ID, &req_id, 1), BT_ERROR_OK);
    assert_int_equal(host_error(&session, BT_SAVE_SETTINGS_ID, &req_id, 1), BT_ERROR_OK);
    assert_true(saves == 1 && bt_settings_get(&saved, BT_SETTING_IDLE_PERIOD_MS) == 250);
    assert_int_equal(reboot_error(0), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(reboot_error(0xB0071DE4), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(reboots, 0);
    assert_int_equal(reboot_error(0xB0071DE5), BT_ERROR_OK);
    assert_true(reboots == 1 && into_bootloader);
    assert_int_equal(reboot_error(BT_RESTART_MAGIC), BT_ERROR_OK);
    assert_true(reboots == 2 && !into_bootloader);
}

static void settings_hold_their_ranges_and_refused_values_change_nothing(void **state)
{
    (void)state;
    for (int k = 0; k < BT_SETTINGS; k++) {
        const bt_setting_spec *spec = &bt_setting_specs[k];
        assert_int_equal(get(spec->id), spec->initial);
        assert_int_equal(set_error(spec->id, spec->min), BT_ERROR_OK);
        assert_int_equal(get(spec->id), spec->min);
        assert_int_equal(set_error(spec->id, spec->min - 1), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(set_error(spec->id, INT32_MIN), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(get(spec->id), spec->min);
        assert_int_equal(set_error(spec->id, spec->max), BT_ERROR_OK);
        assert_int_equal(set_error(spec->id, spec->max + 1), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(set_error(spec->id, INT32_MAX), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(get(spec->id), spec->max);
    }
}

static void a_new_setting_is_what_the_kernels_use(void **state)
{
    (void)state;
    const received_message *message = set(BT_SETTING_FORCE_GAIN_Z_NN, -12345);
    bt_msg_setting value;
    assert_int_equal(message->id, BT_SETTING_ID);
    bt_msg_setting_unpack(&value, message->payload);
    assert_true(value.req_id == 77 && value.value == -12345);
    assert_int_equal(bt_settings_get(&session.settings, BT_SETTING_FORCE_GAIN_Z_NN), -12345);
    assert_int_equal(set_error(BT_SETTING_POC_WEIGHTS, BT_POC_WEIGHTS_ABS_N2), BT_ERROR_OK);
    assert_int_equal(session.solve[0].poc_weights, BT_POC_WEIGHTS_ABS_N2);
    assert_int_equal(set_error(BT_SETTING_CONTACT_ENERGY_COUNT2, 500), BT_ERROR_OK);
    assert_int_equal(session.tare[0].contact_energy_count2, 500);
}

static void settings_are_refused_while_streaming(void **state)
{
    (void)state;
    assert_int_equal(start(BT_STREAM_FLAG_PAC, 1, 0), BT_ERROR_OK);
    assert_int_equal(set_error(BT_SETTING_POC_WEIGHTS, 0), BT_ERROR_BUSY);
    assert_int_equal(get(BT_SETTING_POC_WEIGHTS), BT_POC_WEIGHTS_COMPRESS_N1); // reading is allowed
    assert_int_equal(stop(), BT_ERROR_OK);
    assert_int_equal(set_error(BT_SETTING_POC_WEIGHTS, 0), BT_ERROR_OK);
}

static void a_command_that_comes_twice_is_answered_twice_and_does_no_more(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) { // as a host says it again that had no answer
        assert_int_equal(set_error(BT_SETTING_IDLE_PERIOD_MS, 250), BT_ERROR_OK);
        assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
        assert_int_equal(session.streams, BT_STREAM_FLAG_FRAMES);
        assert_int_equal(stop(), BT_ERROR_OK);
        assert_int_equal(stop(), BT_ERROR_OK);
        assert_int_equal(session.streams, 0);
        assert_int_equal(get(BT_SETTING_IDLE_PERIOD_MS), 250);
    }
}

static void unknown_commands_are_answered_as_such(void **state)
{
    (void)state;
    for (int id = 0x80; id < 0x100; id++) {
        if (bt_wire_payload_bytes((uint8_t)id) < 0) {
            assert_int_equal(host_error(&session, (uint8_t)id, "\x21\x01\x02", 3), BT_ERROR_UNKNOWN_COMMAND);
        } else if (id >= OF_THE_SENSOR_BOARD) {
            uint8_t payload[BT_FRAME_MAX_BYTES] = {0x21};
            assert_int_equal(
                host_error(&session, (uint8_t)id, payload, (size_t)bt_wire_payload_bytes((uint8_t)id)),
                BT_ERROR_UNKNOWN_COMMAND);
        }
    }
}

static void an_unknown_command_without_payload_is_unknown_too(void **state)
{
    (void)state;
    host_send(&session, 0xF0, "", 0, 0); // SPEC.md: a board answers REPLY(UNKNOWN_COMMAND)
    assert_int_equal(host.count, 1);
    assert_int_equal(host.message[0].id, BT_REPLY_ID);
    assert_int_equal(host.message[0].payload[0], 0); // of no request
    assert_int_equal(host.message[0].payload[1], 0xF0);
    assert_int_equal(host.message[0].payload[2], BT_ERROR_UNKNOWN_COMMAND);
}

static void a_wrong_length_is_answered_and_does_nothing(void **state)
{
    (void)state;
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

static void an_echo_of_our_own_messages_is_not_answered(void **state)
{
    (void)state;
    uint8_t payload[BT_FRAME_MAX_BYTES] = {1};
    for (int id = 0; id < 0x80; id++) {
        int bytes = bt_wire_payload_bytes((uint8_t)id);
        host_send(&session, (uint8_t)id, payload, bytes < 0 ? 3 : (size_t)bytes, 0);
        host_send(&session, (uint8_t)id, payload, bytes < 0 ? 0 : (size_t)bytes - 1, 0);
    }
    assert_int_equal(host.count, 0);
}

static void status_that_nobody_asked_for_has_no_req_id(void **state)
{
    (void)state;
    assert_int_equal(start(BT_STREAM_FLAG_STATUS, 0, 0), BT_ERROR_OK);
    host_round(&session, 1 << 3, 2000);
    host_forget();
    bt_session_tick(&session, session.status_period_us);
    assert_int_equal(host_count(BT_STATUS_ID), 1);
    assert_int_equal(host_count(BT_SENSOR_STATUS_ID), 1);
    for (int k = 0; k < host.count; k++) {
        bool status = host.message[k].id == BT_STATUS_ID;
        bt_msg_status of_board;
        bt_msg_sensor_status of_sensor;
        if (status) {
            bt_msg_status_unpack(&of_board, host.message[k].payload);
        } else {
            bt_msg_sensor_status_unpack(&of_sensor, host.message[k].payload);
            assert_int_equal(of_sensor.finger, 3);
        }
        assert_int_equal(status ? of_board.req_id : of_sensor.req_id, 0);
    }
}

static void a_hold_lapses_after_so_many_milliseconds_of_silence(void **state)
{
    (void)state;
    assert_int_equal(bt_settings_set(&session.settings, BT_SETTING_HOLD_TIMEOUT_MS, 700), BT_ERROR_OK);
    bt_session_use_settings(&session);
    assert_int_equal(host_error(&session, BT_HOLD_ID, "\1\4", 2), BT_ERROR_OK); // finger 2, at 0 us
    bt_session_tick(&session, 700000);
    assert_true(session.finger[2].tare.held);
    bt_session_tick(&session, 700001);
    assert_false(session.finger[2].tare.held);
}

static void a_tare_from_the_host_is_told_as_it_was_sent(void **state)
{
    (void)state;
    uint8_t payload[BT_TARE_SET_BYTES];
    bt_msg_tare_set sent = {.req_id = 1, .finger = 2, .pdc_tare_q4 = 20001};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sent.tare_q4[i] = (uint16_t)(40003 + 7 * i);
    }
    bt_msg_tare_set_pack(&sent, payload);
    assert_int_equal(host_error(&session, BT_TARE_SET_ID, payload, sizeof payload), BT_ERROR_OK);
    const bt_tare *tare = &session.finger[2].tare;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        assert_int_equal(bt_tare_q4(tare->base.electrode_q16[i]), sent.tare_q4[i]);
    }
    assert_int_equal(bt_tare_q4(tare->base.pdc_q16), sent.pdc_tare_q4);
}

static void a_board_saves_all_or_says_that_it_cannot(void **state)
{
    (void)state;
    const bt_board_actions whole = {
        .save_settings = keep_settings, .save_calibration = keep_calibration, .save_map = keep_no_map};
    for (int missing = 0; missing <= 3; missing++) {
        bt_board_actions actions = whole;
        actions.save_settings = missing == 1 ? NULL : actions.save_settings;
        actions.save_calibration = missing == 2 ? NULL : actions.save_calibration;
        actions.save_map = missing == 3 ? NULL : actions.save_map;
        bt_session_use_board(&session, &actions);
        assert_int_equal(host_error(&session, BT_SAVE_SETTINGS_ID, "\5", 1),
                         missing == 0 ? BT_ERROR_OK : BT_ERROR_NOT_HERE);
    }
}

static void sigmas_come_back_after_a_pause(void **state)
{
    (void)state;
    session.scheduler.sigma_pause = 3;
    for (int left = 2; left >= -1; left--) {
        host_round(&session, 1 << 2, 2000);
        assert_int_equal(session.scheduler.sigma_pause, left > 0 ? left : 0);
    }
}

#define T(name) cmocka_unit_test_setup(name, new_session)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(hello_tells_who_is_there_and_echoes_the_nonce),
        T(a_board_tells_what_it_can_and_refuses_the_rest),
        T(every_command_gets_exactly_one_reply_with_its_req_id),
        T(errors_are_told_by_name),
        T(settings_hold_their_ranges_and_refused_values_change_nothing),
        T(a_new_setting_is_what_the_kernels_use),
        T(settings_are_refused_while_streaming),
        T(a_command_that_comes_twice_is_answered_twice_and_does_no_more),
        T(unknown_commands_are_answered_as_such),
        T(saving_and_leaving_are_the_boards_to_do),
        T(a_bus_rate_on_trial_ends_with_start_stop_and_a_closed_port),
        T(an_unknown_command_without_payload_is_unknown_too),
        T(a_wrong_length_is_answered_and_does_nothing),
        T(an_echo_of_our_own_messages_is_not_answered),
        T(status_that_nobody_asked_for_has_no_req_id),
        T(a_hold_lapses_after_so_many_milliseconds_of_silence),
        T(a_tare_from_the_host_is_told_as_it_was_sent),
        T(a_board_saves_all_or_says_that_it_cannot),
        T(sigmas_come_back_after_a_pause),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
