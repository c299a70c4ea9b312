// A calibration through changes of sensors and ends of streams, and the stored record. Setting, clearing and
// saving as hosts see them: test_saving.c, tests/hil/test_calibration.py.
#include "fake_board.h"
#include "fake_host.h"

static const int32_t values[BT_CALIBRATION_VALUES] = {BT_POC_WEIGHTS_ABS_N2, 1, -2, 3, -4, 5, -600, 9500000};

static void set(uint8_t finger, const char *serial)
{
    uint8_t payload[BT_SET_CALIBRATION_BYTES];
    bt_msg_set_calibration msg = {.req_id = 31, .finger = finger, .made_s = 1763731310};
    memcpy(msg.serial, serial, strlen(serial));
    memcpy(msg.value, values, sizeof msg.value);
    bt_msg_set_calibration_pack(&msg, payload);
    assert_int_equal(host_ask(&session, BT_SET_CALIBRATION_ID, payload, sizeof payload)->id,
                     BT_CALIBRATION_ID);
}

static bt_msg_calibration get(uint8_t finger)
{
    uint8_t payload[2] = {9, finger};
    bt_msg_calibration msg;
    const received_message *message = host_ask(&session, BT_GET_CALIBRATION_ID, payload, 2);
    assert_int_equal(message->id, BT_CALIBRATION_ID);
    bt_msg_calibration_unpack(&msg, message->payload);
    assert_true(msg.req_id == 9 && msg.finger == finger);
    return msg;
}

static uint8_t clear(uint8_t finger)
{
    uint8_t payload[2] = {9, finger};
    return host_error(&session, BT_CLEAR_CALIBRATION_ID, payload, 2);
}

// That finger's kernels and tare machine work by these values.
static void assert_works_by(uint8_t finger, const int32_t *value)
{
    int32_t force_nn[3] = {value[1], value[2], value[3]}, torque_nn[2] = {value[4], value[5]};
    bt_gains gains = bt_gains_from(force_nn, torque_nn);
    assert_int_equal(session.solve[finger].poc_weights, value[0]);
    assert_memory_equal(&session.solve[finger].gains, &gains, sizeof gains);
    assert_int_equal(session.tare[finger].thermal_gain_q16, bt_thermal_gain_q16(value[6]));
}

static void initial_values(int32_t value[BT_CALIBRATION_VALUES])
{
    bt_settings settings;
    bt_settings_reset(&settings);
    for (int k = 0; k < BT_CALIBRATION_VALUES; k++) {
        value[k] = bt_settings_get(&settings, bt_calibration_setting[k]);
    }
}

static const uint8_t another[BT_SERIAL_BYTES] = "BT-another-one";

static void unplug(int rounds)
{
    for (int k = 0; k < rounds; k++) {
        host_round(&session, 0, 0);
    }
}

TEST(a_sensor_that_comes_back_keeps_its_calibration_and_another_has_none)
{
    plug(0, SENSOR);
    plug(1, SENSOR);
    set(0, SENSOR);
    set(1, "");
    host_round(&session, 3, 2000);
    for (int again = 0; again < 3; again++) {
        unplug(1 << (5 * again));
        assert_int_equal(get(0).state, BT_CALIBRATION_STATE_IN_FORCE);
        assert_int_equal(session.unsure & 3, 3);
        assert_int_equal(bt_sensors_to_ask(&session), 1); // one at a time
        assert_int_equal(bt_sensors_to_ask(&session), 2);
        assert_int_equal(session.unsure & 3, 3);
        bt_sensors_answer(&session, 0, session.info[0].serial);
        bt_sensors_answer(&session, 1, session.info[1].serial);
        assert_int_equal(session.unsure & 3, 0);
        assert_int_equal(bt_sensors_to_ask(&session) & 3, 0); // each asking costs a round
        assert_int_equal(get(0).state, BT_CALIBRATION_STATE_IN_FORCE);
    }
    bt_sensors_answer(&session, 0, another);
    bt_sensors_answer(&session, 1, another);
    assert_int_equal(get(0).state, BT_CALIBRATION_STATE_OTHER_SENSOR);
    assert_int_equal(get(1).state, BT_CALIBRATION_STATE_IN_FORCE);                 // for any sensor
    assert_true(session.info[1].cpu_khz == 0 && session.info[1].sampling_hz == 0); // not yet read
    const uint8_t wanted = session.finger[0].quantities;
    assert_int_not_equal(wanted, 0);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1, 0), BT_ERROR_OK);
    host_round(&session, 1, 2000);
    assert_int_equal(session.finger[0].quantities, wanted); // for the right sensor, when it is back
}

TEST(every_end_of_a_stream_counts)
{
    int32_t initial[BT_CALIBRATION_VALUES];
    initial_values(initial);
    for (int way = 0; way < 4; way++) {
        plug(0, SENSOR);
        set(0, SENSOR);
        host_round(&session, 1, 2000);
        assert_int_equal(start(BT_STREAM_FLAG_PAC, 1, way == 2 ? 100 : 0), BT_ERROR_OK);
        unplug(1);
        bt_sensors_answer(&session, 0, another);
        assert_int_equal(get(0).state, BT_CALIBRATION_STATE_IN_FORCE); // one recording has one set of values
        assert_works_by(0, values);
        if (way == 0) {
            assert_int_equal(stop(), BT_ERROR_OK);
        } else if (way == 1) {
            bt_session_link_down(&session, 0);
        } else if (way == 2) {
            bt_session_tick(&session, 100001); // the host has been silent for too long
        } else {
            assert_int_equal(start(0, 1, 0), BT_ERROR_OK);
        }
        assert_int_equal(get(0).state, BT_CALIBRATION_STATE_OTHER_SENSOR);
        assert_works_by(0, initial);
        assert_memory_equal(get(0).value, values, sizeof values); // it is kept
    }
}

static uint8_t save(void)
{
    records_written = 0;
    return host_error(&session, BT_SAVE_SETTINGS_ID, "\7", 1);
}

TEST(only_what_has_changed_is_stored)
{
    const uint32_t of_finger_0 = 1u << BT_RECORD_CALIBRATION, settings = 1u << BT_RECORD_SETTINGS;
    memset(kept, 0xFF, sizeof kept);
    session.board = keeps;
    assert_int_equal(save(), BT_ERROR_OK);
    assert_int_equal(records_written, settings); // a newer firmware's, unknown here, outlives this
    set(1, "");
    assert_int_equal(clear(3), BT_ERROR_OK);
    assert_int_equal(save(), BT_ERROR_OK);
    assert_int_equal(records_written, of_finger_0 << 1 | of_finger_0 << 3);
    assert_int_equal(save(), BT_ERROR_OK);
    assert_int_equal(records_written, 0);
    refused_record = BT_RECORD_CALIBRATION + 4;
    assert_int_equal(clear(4), BT_ERROR_OK);
    assert_int_equal(save(), BT_ERROR_NOT_STORED);
    assert_int_equal(save(), BT_ERROR_NOT_STORED); // it is tried again
}

TEST(a_record_is_read_back_and_a_strange_one_passed_over)
{
    bt_calibration out = {.present = true, .made_s = 0xFEDCBA98}, back;
    uint8_t record[BT_CALIBRATION_RECORD_BYTES + 1];
    memcpy(out.serial, SENSOR, sizeof out.serial);
    memcpy(out.value, values, sizeof values);
    assert_int_equal(bt_calibration_pack(&out, record), 52);
    // The layout that calibration.h states: serial, made_s, values, little-endian.
    assert_memory_equal(record, SENSOR "\x98\xBA\xDC\xFE\0\0\0\0\1\0\0\0\xFE\xFF\xFF\xFF", 32);
    assert_memory_equal(record + 44, "\xA8\xFD\xFF\xFF\x60\xF5\x90\0", 8); // -600, 9500000
    bt_calibration_unpack(&back, 1, record, 52);
    assert_memory_equal(&back, &out, sizeof out);
    static const struct {
        uint16_t version;
        size_t bytes; // 0: a cleared one
    } strange[] = {{0, 52}, {2, 52}, {1, 51}, {1, 53}, {1, 48}, {1, 0}};
    for (size_t k = 0; k < sizeof strange / sizeof *strange; k++) {
        bt_calibration_unpack(&back, strange[k].version, record, strange[k].bytes);
        assert_false(back.present);
    }
    record[20] = 3; // no such weights
    bt_calibration_unpack(&back, 1, record, 52);
    assert_false(back.present);
    out.present = false;
    assert_int_equal(bt_calibration_pack(&out, record), 0);
}
