#include "talk/saved.h"

#define CALIBRATION_ID(finger) ((uint16_t)(BT_RECORD_CALIBRATION + (finger)))
#define MAP_ID(finger)         ((uint16_t)(BT_RECORD_MAP + (finger)))

_Static_assert(BT_RECORD_SETTINGS < CALIBRATION_ID(0) && CALIBRATION_ID(BT_MAX_FINGERS - 1) < MAP_ID(0)
                   && MAP_ID(BT_MAX_FINGERS - 1) <= BT_STORAGE_IDS,
               "the settings, and every finger's calibration and map, must have a record of their own");
_Static_assert(BT_CALIBRATION_RECORD_BYTES <= BT_SETTINGS_RECORD_BYTES
                   && BT_MAP_RECORD_BYTES <= BT_SETTINGS_RECORD_BYTES
                   && BT_SETTINGS_RECORD_BYTES <= BT_STORAGE_MAX_BYTES,
               "the settings' record must be the longest, and fit");

uint8_t bt_session_save(bt_session *session)
{
    const bt_flash *flash = session->board.flash;
    uint8_t record[BT_SETTINGS_RECORD_BYTES];
    if (flash == NULL) {
        return BT_ERROR_NOT_HERE;
    }
    bt_settings_pack(&session->settings, record);
    bool kept =
        bt_storage_write(flash, BT_RECORD_SETTINGS, BT_SETTINGS_RECORD_VERSION, record, sizeof record);
    // Unchanged records stay as stored: newer firmware may have written one that this firmware cannot read.
    for (int f = 0; f < BT_MAX_FINGERS && kept; f++) {
        bt_calibration *calibration = &session->calibration[f];
        if (calibration->unsaved) {
            const size_t bytes = bt_calibration_pack(calibration, record);
            kept = bt_storage_write(flash, CALIBRATION_ID(f), BT_CALIBRATION_RECORD_VERSION, record, bytes);
            calibration->unsaved = !kept;
        }
    }
    for (int f = 0; f < BT_MAX_FINGERS && kept; f++) {
        bt_finger_map *map = &session->map[f];
        if (map->unsaved) {
            const size_t bytes = bt_map_place_pack(&map->place, record);
            kept = bt_storage_write(flash, MAP_ID(f), BT_MAP_RECORD_VERSION, record, bytes);
            map->unsaved = !kept;
            if (kept) {
                map->stored_slot = bytes != 0 ? map->place.slot : BT_MAP_SLOTS;
            }
        }
    }
    return kept ? BT_ERROR_OK : BT_ERROR_NOT_STORED;
}

void bt_session_load(bt_session *session)
{
    const bt_flash *flash = session->board.flash;
    uint8_t record[BT_STORAGE_MAX_BYTES];
    uint16_t version;
    bool damaged = bt_storage_damaged(flash);
    int bytes = bt_storage_read(flash, BT_RECORD_SETTINGS, &version, record, sizeof record);
    if (bytes > 0) {
        bt_settings_unpack(&session->settings, version, record, (size_t)bytes);
    }
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        bytes = bt_storage_read(flash, CALIBRATION_ID(f), &version, record, sizeof record);
        if (bytes > 0) {
            bt_calibration_unpack(&session->calibration[f], version, record, (size_t)bytes);
        }
        bytes = bt_storage_read(flash, MAP_ID(f), &version, record, sizeof record);
        if (bytes > 0 && session->board.maps != NULL) {
            damaged |=
                !bt_finger_map_load(&session->map[f], session->board.maps, f, version, record, (size_t)bytes);
        }
    }
    session->status.faults |= damaged ? BT_FAULT_FLAG_STORAGE : 0;
    bt_session_use_settings(session);
}
