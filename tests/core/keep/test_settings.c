// Settings, and the record that saves them.
#include "support.h"

#include "keep/settings.h"

TEST(settings_come_back_and_others_keep_their_defaults)
{
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
    // An unknown id, a value out of range and half a pair are skipped.
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
