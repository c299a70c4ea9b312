// What a board does for a session, where a test asks for nothing of it.
#ifndef BIOTAC_TEST_FAKE_BOARD_H
#define BIOTAC_TEST_FAKE_BOARD_H

#include "talk/host_link.h"
#include "talk/rounds.h"
#include "talk/sensors.h"

static inline uint8_t keep_settings(void *context, const bt_settings *settings)
{
    (void)context;
    (void)settings;
    return BT_ERROR_OK;
}

static inline uint8_t keep_calibration(void *context, uint8_t finger, const bt_calibration *calibration)
{
    (void)context;
    (void)finger;
    (void)calibration;
    return BT_ERROR_OK;
}

// Not to be called where no finger has a map to keep.
static inline uint8_t keep_no_map(void *context, uint8_t finger, const bt_map_place *place)
{
    (void)context;
    (void)finger;
    (void)place;
    return BT_ERROR_NOT_STORED;
}

#endif
