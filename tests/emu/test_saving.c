// Settings and calibrations from the command through the gateway into flash, and back at the next boot.
#include "rig.h"

static void set(uint8_t setting, int32_t value)
{
    uint8_t payload[BT_SET_SETTING_BYTES];
    bt_msg_set_setting msg = {.req_id = 1, .setting = setting, .value = value};
    bt_msg_set_setting_pack(&msg, payload);
    (void)ask(BT_SET_SETTING_ID, payload);
    assert_int_equal(bt_settings_get(&gateway.session.settings, setting), value);
}

TEST(saved_settings_are_in_force_after_the_next_boot)
{
    boot(START_NS);
    assert_int_equal(ask(BT_SAVE_SETTINGS_ID, "\1"), BT_ERROR_BUSY);
    assert_int_equal(ask(BT_STOP_ID, "\1"), BT_ERROR_OK);
    set(BT_SETTING_IDLE_PERIOD_MS, 250);
    assert_int_equal(ask(BT_SAVE_SETTINGS_ID, "\1"), BT_ERROR_OK);
    set(BT_SETTING_CONTACT_ENERGY_COUNT2, 77); // not saved
    power_cycle();
    assert_int_equal(bt_settings_get(&gateway.session.settings, BT_SETTING_IDLE_PERIOD_MS), 250);
    assert_int_equal(gateway.session.idle_rounds, 25); // and the session works with it
    assert_int_equal(bt_settings_get(&gateway.session.settings, BT_SETTING_CONTACT_ENERGY_COUNT2), 1000);
}

// ---- calibrations --------------------------------------------------------------------------------------

static uint8_t calibrate(uint8_t finger, int32_t gain_nn, bool forced)
{
    uint8_t payload[BT_SET_CALIBRATION_BYTES];
    bt_msg_set_calibration msg = {.req_id = 1, .finger = finger, .made_s = 5};
    for (int k = 1; k < BT_CALIBRATION_VALUES; k++) {
        msg.value[k] = gain_nn;
    }
    if (!forced) {
        memcpy(msg.serial, gateway.session.info[finger].serial, sizeof msg.serial);
    }
    bt_msg_set_calibration_pack(&msg, payload);
    (void)ask(BT_SET_CALIBRATION_ID, payload);
    return gateway.session.calibration_state[finger];
}

TEST(a_saved_uart_rate_is_believed_after_a_good_frame)
{
    boot(START_NS);
    (void)ask(BT_STOP_ID, "\1");
    set(BT_SETTING_UART_BITS_PER_S, 9600);
    (void)ask(BT_SAVE_SETTINGS_ID, "\1");
    power_cycle();
    for (int k = 0; k < 6; k++) { // a host at another rate, and from the third time on one at this
        assert_int_equal(fake.bits_per_s, k == 1 ? 0 : 9600);
        assert_int_equal(k < 2 ? 0 : ask(BT_STOP_ID, "\1"), BT_ERROR_OK);
        fake_host_sends((uint8_t[64]){1, 2, 3}, 64);
        bt_gateway_poll(&gateway);
    }
}

TEST(saved_calibrations_hold_for_their_own_sensors_alone)
{
    const bt_session *session = &gateway.session;
    boot(START_NS);
    assert_int_equal(ask(BT_STOP_ID, "\1"), BT_ERROR_OK);
    assert_int_equal(calibrate(0, 10, false), BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(calibrate(1, 20, true), BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(calibrate(4, 30, false), BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(ask(BT_SAVE_SETTINGS_ID, "\1"), BT_ERROR_OK);
    assert_int_equal(calibrate(2, 40, false), BT_CALIBRATION_STATE_IN_FORCE); // not saved
    power_cycle();
    static const uint8_t same[BT_MAX_FINGERS] = {BT_CALIBRATION_STATE_IN_FORCE, BT_CALIBRATION_STATE_IN_FORCE,
                                                 0, 0, BT_CALIBRATION_STATE_IN_FORCE};
    assert_memory_equal(session->calibration_state, same, sizeof same);
    assert_int_equal(session->calibration[4].value[1], 30);
    // Fingers 0 and 1 change places: only forced values may follow the place.
    fake.bus.sensor[0].serial[15] ^= 3;
    fake.bus.sensor[1].serial[15] ^= 3;
    power_cycle();
    static const uint8_t swapped[BT_MAX_FINGERS] = {BT_CALIBRATION_STATE_OTHER_SENSOR,
                                                    BT_CALIBRATION_STATE_IN_FORCE, 0, 0,
                                                    BT_CALIBRATION_STATE_IN_FORCE};
    assert_memory_equal(session->calibration_state, swapped, sizeof swapped);
    assert_int_equal(session->calibration[0].value[1], 10); // kept
    // Absent, as another.
    fake.bus.sensor[4].present = false;
    power_cycle();
    assert_int_equal(session->calibration_state[4], BT_CALIBRATION_STATE_OTHER_SENSOR);
}

TEST(a_cleared_calibration_stays_cleared_once_saved)
{
    static const uint8_t finger_1[2] = {1, 1};
    boot(START_NS);
    assert_int_equal(ask(BT_STOP_ID, "\1"), BT_ERROR_OK);
    assert_int_equal(calibrate(1, 20, false), BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(ask(BT_SAVE_SETTINGS_ID, "\1"), BT_ERROR_OK);
    assert_int_equal(ask(BT_CLEAR_CALIBRATION_ID, finger_1), BT_ERROR_OK);
    power_cycle();
    assert_int_equal(gateway.session.calibration_state[1], BT_CALIBRATION_STATE_IN_FORCE);
    assert_int_equal(ask(BT_CLEAR_CALIBRATION_ID, finger_1), BT_ERROR_OK);
    assert_int_equal(ask(BT_SAVE_SETTINGS_ID, "\1"), BT_ERROR_OK);
    power_cycle();
    assert_int_equal(gateway.session.calibration_state[1], BT_CALIBRATION_STATE_NONE);
}

TEST(a_flash_that_takes_nothing_is_told)
{
    boot(START_NS);
    assert_int_equal(ask(BT_STOP_ID, "\1"), BT_ERROR_OK);
    fake.flash_broken = true;
    assert_int_equal(ask(BT_SAVE_SETTINGS_ID, "\1"), BT_ERROR_NOT_STORED);
}

TEST(a_board_without_a_loader_says_so)
{
    uint8_t payload[BT_REBOOT_BOOTLOADER_BYTES];
    bt_msg_reboot_bootloader msg = {.req_id = 1, .magic = BT_BOOTLOADER_MAGIC};
    bt_msg_reboot_bootloader_pack(&msg, payload);
    boot(START_NS);
    assert_int_equal(ask(BT_REBOOT_BOOTLOADER_ID, payload), BT_ERROR_NOT_HERE);
    fake.has_loader = true;
    assert_int_equal(ask(BT_REBOOT_BOOTLOADER_ID, payload), BT_ERROR_OK);
    assert_int_equal(fake.reboots, 2);
}
