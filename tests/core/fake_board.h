// What a board does for a session, where a test asks for nothing of it.
#ifndef BIOTAC_TEST_FAKE_BOARD_H
#define BIOTAC_TEST_FAKE_BOARD_H

#include "talk/host.h"
#include "talk/rounds.h"
#include "talk/sensors.h"

static inline uint8_t keep_settings(const bt_settings *settings)
{
    (void)settings;
    return BT_ERROR_OK;
}

static inline uint8_t keep_calibration(uint8_t finger, const bt_calibration *calibration)
{
    (void)finger;
    (void)calibration;
    return BT_ERROR_OK;
}

// Not to be called where no finger has a map to keep.
static inline uint8_t keep_no_map(uint8_t finger, const bt_map_place *place)
{
    (void)finger;
    (void)place;
    return BT_ERROR_NOT_STORED;
}

#endif
