#include "keep/settings.h"

#include "wire/little_endian.h"

static int find(uint8_t id)
{
    for (int k = 0; k < BT_SETTINGS; k++) {
        if (bt_setting_specs[k].id == id) {
            return k;
        }
    }
    return -1;
}

void bt_settings_reset(bt_settings *settings)
{
    for (int k = 0; k < BT_SETTINGS; k++) {
        settings->value[k] = bt_setting_specs[k].initial;
    }
}

uint8_t bt_settings_has(uint8_t id)
{
    return find(id) >= 0;
}

int32_t bt_settings_get(const bt_settings *settings, uint8_t id)
{
    int at = find(id);
    return at < 0 ? 0 : settings->value[at];
}

uint8_t bt_settings_set(bt_settings *settings, uint8_t id, int32_t value)
{
    int at = find(id);
    if (at < 0) {
        return BT_ERROR_UNKNOWN_SETTING;
    }
    if (value < bt_setting_specs[at].min || value > bt_setting_specs[at].max) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    settings->value[at] = value;
    return BT_ERROR_OK;
}

void bt_settings_pack(const bt_settings *settings, uint8_t record[BT_SETTINGS_RECORD_BYTES])
{
    for (int k = 0; k < BT_SETTINGS; k++) {
        uint8_t *pair = record + k * BT_SETTING_PAIR_BYTES;
        pair[0] = bt_setting_specs[k].id;
        bt_put_u32(pair + 1, (uint32_t)settings->value[k]);
    }
}

void bt_settings_unpack(bt_settings *settings, uint16_t version, const uint8_t *record, size_t bytes)
{
    if (version != BT_SETTINGS_RECORD_VERSION) {
        return;
    }
    for (; bytes >= BT_SETTING_PAIR_BYTES; record += BT_SETTING_PAIR_BYTES, bytes -= BT_SETTING_PAIR_BYTES) {
        // A refused value changes nothing.
        (void)bt_settings_set(settings, record[0], (int32_t)bt_get_u32(record + 1));
    }
}
