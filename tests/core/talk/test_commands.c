// Effects of commands: settings keep their ranges, the board saves and tries a bus rate.
#include "fake_board.h"
#include "fake_host.h"

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

TEST(settings_hold_their_ranges_and_refused_values_change_nothing)
{
    for (int k = 0; k < BT_SETTINGS; k++) {
        const bt_setting_spec *spec = &bt_setting_specs[k];
        assert_int_equal(get(spec->id), spec->initial);
        assert_int_equal(set_setting(spec->id, spec->min), BT_ERROR_OK);
        assert_int_equal(set_setting(spec->id, spec->min - 1), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(set_setting(spec->id, INT32_MIN), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(get(spec->id), spec->min);
        assert_int_equal(set_setting(spec->id, spec->max), BT_ERROR_OK);
        assert_int_equal(set_setting(spec->id, spec->max + 1), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(set_setting(spec->id, INT32_MAX), BT_ERROR_OUT_OF_RANGE);
        assert_int_equal(get(spec->id), spec->max);
    }
    assert_int_equal(set_setting(0, 1), BT_ERROR_UNKNOWN_SETTING);
}

static uint8_t save_error(void)
{
    return host_error(&session, BT_SAVE_SETTINGS_ID, "\5", 1);
}

TEST(a_board_saves_all_or_says_that_it_cannot)
{
    memset(kept, 0xFF, sizeof kept);
    assert_int_equal(set_setting(BT_SETTING_IDLE_PERIOD_MS, 250), BT_ERROR_OK);
    assert_int_equal(save_error(), BT_ERROR_NOT_HERE);
    session.board = keeps;
    assert_int_equal(save_error(), BT_ERROR_OK);
    new_session();
    session.board = keeps;
    bt_session_load(&session);
    assert_int_equal(get(BT_SETTING_IDLE_PERIOD_MS), 250);
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

// A rate on trial must not outlive the program that tries it: words would come damaged, with good parity
// some.
TEST(a_bus_rate_on_trial_ends_with_start_stop_and_a_closed_port)
{
    static const uint8_t at_6_mhz[BT_SET_BUS_RATE_BYTES] = {1, 6000 & 0xFF, 6000 >> 8};
    static const bt_board_actions actions = {.measure = measure, .set_bus_rate = set_bus_rate};
    assert_int_equal(host_error(&session, BT_SET_BUS_RATE_ID, at_6_mhz, sizeof at_6_mhz), BT_ERROR_NOT_HERE);
    session.board = actions;
    for (int way = 0; way < 3; way++) {
        const received_message *answer = host_ask(&session, BT_SET_BUS_RATE_ID, at_6_mhz, sizeof at_6_mhz);
        assert_true(bus_khz == 6000 && answer->id == BT_BOARD_FACTS_ID);
        if (way == 0) {
            assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
            assert_int_equal(bus_khz, 4464);
            assert_int_equal(stop(), BT_ERROR_OK);
        } else if (way == 1) {
            assert_int_equal(stop(), BT_ERROR_OK);
        } else {
            bt_session_link_down(&session, 0);
        }
        assert_int_equal(bus_khz, 4464);
    }
}

TEST(a_hold_lapses_after_so_many_milliseconds_of_silence)
{
    assert_int_equal(set_setting(BT_SETTING_HOLD_TIMEOUT_MS, 700), BT_ERROR_OK);
    assert_int_equal(host_error(&session, BT_HOLD_ID, "\1\4", 2), BT_ERROR_OK); // finger 2, at 0 us
    bt_session_tick(&session, 700000);
    assert_true(session.finger[2].tare.held);
    bt_session_tick(&session, 700001);
    assert_false(session.finger[2].tare.held);
    assert_int_equal(set_setting(BT_SETTING_HOLD_TIMEOUT_MS, 0), BT_ERROR_OK); // never
    assert_int_equal(host_error(&session, BT_HOLD_ID, "\1\4", 2), BT_ERROR_OK);
    bt_session_tick(&session, 2000000000);
    assert_true(session.finger[2].tare.held);
}

TEST(a_sensor_is_in_doubt_after_half_a_rounds_words_without_an_answer_and_not_before)
{
    static const uint8_t serial[BT_SERIAL_BYTES] = "BT00000000000017";
    uint16_t count[BT_MAX_FINGERS] = {2000, 2000, 2000, 2000, 2000};
    bt_sensors_answer(&session, 3, serial);
    for (int word = 1; word <= 44; word++) {
        count[3] = word == 22 ? 2000 : BT_INVALID_COUNT; // one good word begins the count anew
        bt_sensors_slot(&session, count);
        assert_int_equal(bt_sensors_flags(&session, 3), word < 44 ? 0 : BT_FRAME_FLAG_SENSOR_UNSURE);
    }
    bt_sensors_slot(&session, count); // a sensor that stays away
    bt_sensors_answer(&session, 3, serial);
    assert_int_equal(bt_sensors_flags(&session, 3), 0);
    count[3] = BT_INVALID_COUNT;
    bt_sensors_slot(&session, count);
    assert_int_equal(bt_sensors_flags(&session, 3), 0);
}
