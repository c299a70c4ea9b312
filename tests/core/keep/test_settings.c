// Settings as the record that is saved of them.
#include "support.h"

#include "keep/settings.h"

static void settings_come_back_and_others_keep_their_defaults(void **state)
{
    (void)state;
    bt_settings settings, back;
    uint8_t record[BT_SETTINGS_RECORD_BYTES + 7];
    bt_settings_reset(&settings);
    for (int k = 0; k < BT_SETTINGS; k++) {
        settings.value[k] = k % 2 == 0 ? bt_setting_specs[k].min : bt_setting_specs[k].max;
    }
    bt_settings_pack(&settings, record);
    bt_settings_reset(&back);
    bt_settings_unpack(&back, BT_SETTINGS_RECORD_VERSION, record, BT_SETTINGS_RECORD_BYTES);
    assert_memory_equal(&back, &settings, sizeof back);
    // An unknown id, a value out of range and half a pair are passed over.
    memcpy(record + BT_SETTINGS_RECORD_BYTES, "\xFA\1\0\0\0\1\2", 7);
    record[1] = record[2] = record[3] = record[4] = 0x7F;
    bt_settings_reset(&back);
    settings.value[0] = bt_setting_specs[0].initial;
    bt_settings_unpack(&back, BT_SETTINGS_RECORD_VERSION, record, sizeof record);
    assert_memory_equal(&back, &settings, sizeof back);
    bt_settings_reset(&back);
    bt_settings_unpack(&back, BT_SETTINGS_RECORD_VERSION + 1, record, sizeof record);
    bt_settings_reset(&settings);
    assert_memory_equal(&back, &settings, sizeof back);
}

// Whoever saved settings with a firmware before wire 1.5 goes on with the force that it computed.
static void a_record_without_the_force_model_means_lins(void **state)
{
    (void)state;
    bt_settings settings;
    uint8_t record[BT_SETTINGS_RECORD_BYTES];
    bt_settings_reset(&settings);
    assert_int_equal(bt_settings_get(&settings, BT_SETTING_FORCE_MODEL), BT_FORCE_MODEL_POPULATION);
    bt_settings_pack(&settings, record);
    const size_t without = (BT_SETTING_FORCE_MODEL - 1) * BT_SETTING_PAIR_BYTES; // it and what came later
    assert_int_equal(record[without], BT_SETTING_FORCE_MODEL);
    bt_settings_unpack(&settings, BT_SETTINGS_RECORD_VERSION, record, without);
    assert_int_equal(bt_settings_get(&settings, BT_SETTING_FORCE_MODEL), BT_FORCE_MODEL_LIN);
    bt_settings_unpack(&settings, BT_SETTINGS_RECORD_VERSION, record, sizeof record);
    assert_int_equal(bt_settings_get(&settings, BT_SETTING_FORCE_MODEL), BT_FORCE_MODEL_POPULATION);
    for (int k = 0; k < BT_SETTINGS; k++) {
        settings.value[k] = bt_setting_specs[k].before + 1;
    }
    bt_settings_unpack(&settings, BT_SETTINGS_RECORD_VERSION, record, 0);
    for (int k = 0; k < BT_SETTINGS; k++) { // likewise of every other
        assert_int_equal(settings.value[k], bt_setting_specs[k].before);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settings_come_back_and_others_keep_their_defaults),
        cmocka_unit_test(a_record_without_the_force_model_means_lins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
