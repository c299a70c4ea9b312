#include "touch/thermal.h"

#include "fixed_point.h"
#include "signal/round.h"

#define TDC_SHIFT   3 // a low-pass of 8 rounds, as a step of TDC is half an electrode count
#define SLOW_SHIFT  7
#define APPLIED_MAX (500 << 16) // 15 degrees; more is a broken thermometer

_Static_assert((int64_t)BT_SETTING_THERMAL_GAIN_MILLI_MAX * 65536 / 1000 <= INT32_MAX,
               "a gain must fit its type");

int32_t bt_thermal_gain_q16(int32_t gain_milli)
{
    return (int32_t)bt_div_round((int64_t)gain_milli * 65536, 1000);
}

void bt_thermal_add(bt_thermal *thermal, uint16_t tdc, bool end_of_sweep)
{
    if (!bt_count_usable(tdc)) {
        return; // the last temperature holds
    }
    uint32_t tdc_q8 = (uint32_t)tdc << 8;
    if (thermal->tdc_q8 == 0) {
        thermal->tdc_q8 = tdc_q8;
        thermal->tdc_then_q8 = tdc_q8;
        thermal->slow_q14 = (int32_t)(tdc_q8 << 6);
        return;
    }
    thermal->tdc_q8 += (uint32_t)bt_shift_down((int32_t)(tdc_q8 - thermal->tdc_q8), TDC_SHIFT);
    if (end_of_sweep) {
        int32_t ahead_q14 = (int32_t)(thermal->tdc_q8 << 6) - thermal->slow_q14;
        thermal->slow_q14 += bt_shift_down(ahead_q14, SLOW_SHIFT);
    }
}

// On a ramp the slow low-pass lags the other by 128 sweeps.
int32_t bt_thermal_rate_q16(const bt_thermal *thermal, int32_t gain_q16)
{
    int32_t ahead_q14 = (int32_t)(thermal->tdc_q8 << 6) - thermal->slow_q14;
    return (int32_t)((int64_t)ahead_q14 * gain_q16 / (1 << (14 + SLOW_SHIFT)));
}

void bt_thermal_begin(bt_thermal *thermal)
{
    thermal->tdc_then_q8 = thermal->tdc_q8;
    thermal->applied_q16 = 0;
    thermal->step_q16 = 0;
}

void bt_thermal_follow(bt_thermal *thermal, int32_t gain_q16)
{
    int64_t due_q16 = (int64_t)bt_thermal_warmed_q8(thermal) * gain_q16 / 256;
    due_q16 = due_q16 > APPLIED_MAX ? APPLIED_MAX : due_q16 < -APPLIED_MAX ? -APPLIED_MAX : due_q16;
    thermal->step_q16 = (int32_t)due_q16 - thermal->applied_q16;
    thermal->applied_q16 = (int32_t)due_q16;
}
