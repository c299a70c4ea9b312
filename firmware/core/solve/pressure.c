#include "solve/pressure.h"

#include "fixed_point.h"
#include "signal/round.h"

#define NN_PER_100UN 100000
#define MILLI        1000

_Static_assert((int64_t)(BT_FULL_SCALE_COUNT * 256) * BT_SETTING_PRESSURE_FILTER_MILLI_MAX <= INT32_MAX,
               "a weighted step must fit 32 bits");
_Static_assert((int64_t)BT_E_MAX_Q4 *BT_SETTING_PRESSURE_GAIN_NN_MAX / 16 / NN_PER_100UN <= INT32_MAX,
               "a force must fit its type");
_Static_assert(BT_SETTING_PRESSURE_GAIN_NN_MIN == 0 && BT_SETTING_PRESSURE_FILTER_MILLI_MAX == MILLI,
               "no gain may be negative, and no filter may overshoot");

void bt_pressure_use(bt_pressure *pressure, const bt_settings *settings)
{
    pressure->gain_nn = bt_settings_get(settings, BT_SETTING_PRESSURE_GAIN_NN);
    pressure->filter_milli = bt_settings_get(settings, BT_SETTING_PRESSURE_FILTER_MILLI);
}

void bt_pressure_add(bt_pressure *pressure, uint16_t pdc)
{
    if (!bt_count_usable(pdc)) {
        pressure->known = false;
        return;
    }
    int32_t step_q8 = ((int32_t)pdc << 8) - pressure->filtered_q8;
    if (!pressure->known) {
        pressure->known = true;
        pressure->filtered_q8 += step_q8;
        return;
    }
    uint32_t weighed = bt_abs32(step_q8 * pressure->filter_milli);
    pressure->filtered_q8 += bt_with_sign(bt_div_round_u32(weighed, MILLI), step_q8);
}

uint16_t bt_pressure_filtered_q4(const bt_pressure *pressure)
{
    return pressure->known ? (uint16_t)bt_shift_round(pressure->filtered_q8, 4) : BT_INVALID_COUNT;
}

int32_t bt_pressure_force(uint16_t filtered_q4, uint16_t tare_q4, int32_t gain_nn)
{
    if (filtered_q4 == BT_INVALID_COUNT || tare_q4 == BT_INVALID_COUNT || gain_nn == 0) {
        return BT_INVALID_I32;
    }
    int64_t force_nn_q4 = (int64_t)((int32_t)filtered_q4 - tare_q4) * gain_nn;
    return (int32_t)bt_div_round(force_nn_q4, 16 * NN_PER_100UN);
}
