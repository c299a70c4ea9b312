// The board's settings: one int32 each, ranges and defaults generated from link.toml.
#ifndef BIOTAC_SETTINGS_H
#define BIOTAC_SETTINGS_H

#include "wire/messages_gen.h"

#include <stddef.h>
#include <stdint.h>

typedef struct {
    int32_t value[BT_SETTINGS]; // in the order of bt_setting_specs
} bt_settings;

void bt_settings_reset(bt_settings *settings);

// id must be an enum bt_setting; any other is a programming error and gives 0.
int32_t bt_settings_get(const bt_settings *settings, uint8_t id);

// Returns an enum bt_error: OK, UNKNOWN_SETTING or OUT_OF_RANGE; a refused value changes nothing.
uint8_t bt_settings_set(bt_settings *settings, uint8_t id, int32_t value);

uint8_t bt_settings_has(uint8_t id);

// The stored record: pairs of u8 id and i32 value. Firmware with other settings or ranges uses the pairs that
// it knows and accepts; every other setting stays as it was.
#define BT_SETTINGS_RECORD_VERSION 1
#define BT_SETTING_PAIR_BYTES      5
#define BT_SETTINGS_RECORD_BYTES   (BT_SETTINGS * BT_SETTING_PAIR_BYTES)
void bt_settings_pack(const bt_settings *settings, uint8_t record[BT_SETTINGS_RECORD_BYTES]);

// A record of another version changes nothing.
void bt_settings_unpack(bt_settings *settings, uint16_t version, const uint8_t *record, size_t bytes);

#endif
