// Two fingers in the middle of their lives: one untouched, one pressed half a second ago.
#include "scenes.h"

static bt_tare resting, touched;
static bt_frame rest_frame, press_frame;
static bt_msg_frame message;

static void rest_tare(const bt_kernel_settings *settings)
{
    bt_tare_update(&resting, &rest_frame, settings->contact_energy_count2);
}

static void contact_tare(const bt_kernel_settings *settings)
{
    bt_tare_update(&touched, &press_frame, settings->contact_energy_count2);
}

static void rest_round(const bt_kernel_settings *settings)
{
    rest_tare(settings);
    bt_results(&rest_frame, &resting, settings, &message);
}

static void contact_round(const bt_kernel_settings *settings)
{
    contact_tare(settings);
    bt_results(&press_frame, &touched, settings, &message);
}

const bench_scene bench_scenes[BENCH_SCENES] = {
    {"tare", "at rest", rest_tare},
    {"tare", "in contact", contact_tare},
    {"whole frame", "at rest", rest_round},
    {"whole frame", "in contact", contact_round},
};

void bench_scenes_init(const bt_kernel_settings *settings)
{
    bt_tare_reset(&resting);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        rest_frame.electrode[i] = (uint16_t)(2900 + 7 * i);
        press_frame.electrode[i] = (uint16_t)(rest_frame.electrode[i] - 20 * (i % 13) - 40);
    }
    rest_frame.pdc = 2400;
    press_frame.pdc = 2500;
    for (int k = 0; k < 400; k++) {
        rest_tare(settings);
    }
    touched = resting;
    for (int k = 0; k < 50; k++) {
        contact_tare(settings);
    }
}
