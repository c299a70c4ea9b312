// Who is there, and what one says when asked.
#include "fake_host.h"

#include "talk/sensors.h"

#include <math.h>

TEST(each_finger_has_its_own_flags_of_who_is_there)
{
    for (unsigned f = 0; f < BT_MAX_FINGERS; f++) {
        session.unsure = (uint8_t)(1u << f);
        session.other = session.refused = (uint8_t)(1u << (f + 1) % BT_MAX_FINGERS);
        for (unsigned k = 0; k < BT_MAX_FINGERS; k++) {
            bool other = k == (f + 1) % BT_MAX_FINGERS;
            uint32_t want = k == f ? BT_FRAME_FLAG_SENSOR_UNSURE : other ? BT_FRAME_FLAG_SENSOR_OTHER : 0;
            assert_int_equal(bt_sensors_flags(&session, k), want);
            uint8_t ask[2] = {1, (uint8_t)k};
            assert_int_equal(host_error(&session, BT_GET_POINT_ID, ask, 2),
                             other ? BT_ERROR_OTHER_SENSOR : BT_ERROR_NO_SUCH_FINGER);
        }
    }
}

TEST(another_sensor_has_nothing_of_the_one_before)
{
    static const uint8_t one[BT_SERIAL_BYTES] = "BT-1", two[BT_SERIAL_BYTES] = "BT-2";
    bt_sensors_answer(&session, 2, one);
    for (int k = 0; k < 100; k++) {
        host_round(&session, 1 << 2, 2000);
    }
    bt_sensors_answer(&session, 2, one);
    assert_true(session.finger[2].tare.tared);
    bt_sensors_answer(&session, 2, two);
    assert_false(session.finger[2].tare.tared);
}

TEST(a_sensor_that_is_unplugged_is_not_present)
{
    static const uint8_t ask[2] = {1, 2};
    for (int known = 0; known <= 1; known++) {
        for (int silent = BT_UNPLUGGED_ROUNDS - 1; silent <= BT_UNPLUGGED_ROUNDS; silent++) {
            bt_msg_sensor_info info;
            session.info[2].present = (uint8_t)known;
            host_round(&session, 1 << 2, 2000);
            for (int k = 0; k < silent; k++) {
                host_round(&session, 0, 2000);
            }
            bt_msg_sensor_info_unpack(&info, host_ask(&session, BT_GET_SENSOR_INFO_ID, ask, 2)->payload);
            assert_int_equal(info.present, known && silent < BT_UNPLUGGED_ROUNDS);
        }
    }
}

TEST(a_point_is_that_of_what_is_read_now)
{
    static const uint8_t ask[2] = {1, 2};
    bt_msg_point point;
    for (int k = 0; k < 60; k++) {
        host_round(&session, 1 << 2, 2000);
        bt_msg_point_unpack(&point, host_ask(&session, BT_GET_POINT_ID, ask, 2)->payload);
        bool tared = session.finger[2].tare.tared; // and yet nothing touches: no point
        assert_true(point.poc_um[0] == BT_INVALID_I16 || tared);
        assert_int_equal(point.tare_state, session.finger[2].tare.state);
    }
    session.finger[2].round.electrode[16] = 1000; // E17 alone: the point is where it lies
    bt_msg_point_unpack(&point, host_ask(&session, BT_GET_POINT_ID, ask, 2)->payload);
    double r = hypot(bt_electrode_um[16][1], bt_electrode_um[16][2]) / BT_CORE_RADIUS_UM;
    assert_true(bt_electrode_um[16][0] < 0); // on the cylinder
    assert_true(abs(point.poc_um[0] - bt_electrode_um[16][0]) <= 1);
    for (int d = 1; d < 3; d++) {
        assert_true(fabs(point.poc_um[d] - bt_electrode_um[16][d] / r) < 2);
    }
}

static void word_comes(bool good)
{
    const uint16_t count[BT_MAX_FINGERS] = {2000, 2000, good ? 2000 : BT_INVALID_COUNT, 2000, 2000};
    bt_sensors_slot(&session, count);
}

// 22 words in a row that did not come.
TEST(who_is_silent_for_half_a_round_is_in_doubt)
{
    static const uint8_t serial[BT_SERIAL_BYTES] = "BT-1";
    bt_sensors_answer(&session, 2, serial);
    for (int k = 0; k < 200; k++) {
        word_comes(k % 22 == 21);
    }
    assert_int_equal(session.unsure >> 2 & 1, 0);
    session.query[2].bad_words = 0;
    for (int k = 1; k <= 22; k++) {
        word_comes(false);
        assert_int_equal(session.unsure >> 2 & 1, k == 22);
    }
    bt_sensors_answer(&session, 2, serial); // it is the same
    assert_int_equal(session.unsure >> 2 & 1, 0);
    word_comes(false);
    assert_int_equal(session.unsure >> 2 & 1, 0);
}

// Every tenth round at first, then every hundredth; anew when it is back from a silence.
TEST(who_does_not_say_who_it_is_is_asked_again)
{
    int last = -1, times = 0;
    bt_sensors_doubt(&session, 2);
    for (int k = 0; k < 1000; k++) {
        uint8_t mask = bt_sensors_to_ask(&session);
        assert_true(mask == 0 || mask == 1 << 2);
        if (mask == 0) {
            continue;
        }
        if (last >= 0) {
            assert_in_range(k - last, times < 10 ? 10 : 100, times < 10 ? 11 : 101);
        }
        last = k;
        times++;
    }
    assert_in_range(times, 10 + 8, 10 + 9);
    session.finger[2].present = true;
    assert_int_equal(bt_sensors_to_ask(&session), 1 << 2);
    assert_int_equal(bt_sensors_to_ask(&session), 0);
    session.asked = 1 << 2; // in this round it is not seen
    session.finger[2].present = false;
    assert_int_equal(bt_sensors_to_ask(&session), 0);
    session.asked = 0;
    session.finger[2].present = true;
    assert_int_equal(bt_sensors_to_ask(&session), 0); // so it was there all along
}

TEST(a_tares_age_is_told_in_milliseconds)
{
    static const uint8_t ask[2] = {1, 2};
    while (!session.finger[2].tare.tared) {
        host_round(&session, 1 << 2, 2000);
    }
    for (unsigned rounds = 0; rounds < 100; rounds++) {
        bt_msg_sensor_status status;
        bt_msg_sensor_status_unpack(&status, host_ask(&session, BT_GET_SENSOR_STATUS_ID, ask, 2)->payload);
        assert_int_equal(status.tare_age_ms, 10 * rounds);
        host_round(&session, 1 << 2, 2000);
    }
}

// Who may be another sensor than the one whose calibration is in force has no results.
TEST(who_is_refused_has_no_results)
{
    for (int k = 0; k < 60; k++) {
        host_round(&session, 1 << 2, 2000);
    }
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 2, 0), BT_ERROR_OK);
    session.finger[2].quantities = 0x7F;
    for (int refused = 0; refused <= 1; refused++) {
        bt_msg_frame frame;
        session.refused = (uint8_t)(refused << 2);
        host_forget();
        host_round(&session, 1 << 2, 1950);
        bt_msg_frame_unpack(&frame, host.message[host.count - 1].payload);
        assert_int_equal(host.message[host.count - 1].id, BT_FRAME_ID);
        assert_int_equal(frame.poc_um[0] == BT_INVALID_I16, refused);
        assert_int_equal(frame.force_100un[0] == BT_INVALID_I32, refused);
        assert_int_equal(frame.pdc_filtered_q4 == BT_INVALID_COUNT, refused);
        assert_int_equal(session.finger[2].quantities, 0x7F); // asked for as before
    }
}

// Two sensors changed while they stream, for ones of other calibrations; then one of them for one of the
// same.
TEST(a_refused_finger_stays_so_whatever_becomes_of_the_others)
{
    static const uint8_t serial[3][BT_SERIAL_BYTES] = {"BT-1", "BT-2", "BT-3"};
    for (unsigned f = 1; f <= 3; f += 2) {
        bt_sensors_answer(&session, f, serial[0]);
    }
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 1 | 1 << 3, 0), BT_ERROR_OK);
    const uint8_t same = session.calibration_state[1];
    session.calibration_state[1] = session.calibration_state[3] = (uint8_t)(same + 1);
    bt_sensors_answer(&session, 1, serial[1]);
    assert_int_equal(session.refused, 1 << 1);
    bt_sensors_answer(&session, 3, serial[1]);
    assert_int_equal(session.refused, 1 << 1 | 1 << 3);
    session.calibration_state[1] = same;
    bt_sensors_answer(&session, 1, serial[2]);
    assert_int_equal(session.refused, 1 << 3);
    assert_int_equal(session.other, 1 << 1 | 1 << 3);
}

int main(void)
{
    return run_all(NULL, new_session);
}
