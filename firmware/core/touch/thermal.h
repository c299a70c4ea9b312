// Temperature compensation of a touched finger's tare. Warmer fluid conducts better, so every count at rest
// rises; while a contact freezes the tare, it follows the sensor's own thermometer (TDC).
//
// All electrodes follow by the same counts. On real fingers TDC alone does not suffice (gradients in the
// core), which is why a change is flagged.
//
// Units: TDC counts in 1/256 (q8), electrode counts in 1/65536 (q16). Products round towards zero.
#ifndef BIOTAC_THERMAL_H
#define BIOTAC_THERMAL_H

#include "wire/touch_gen.h"

#include <stdbool.h>
#include <stdint.h>

#define BT_DEGREE_Q8 (BT_DEGREE_TDC << 8)

typedef struct {
    uint32_t tdc_q8;      // low-passed over 8 rounds; 0 until read
    int32_t slow_q14;     // low-passed over 128 sweeps more
    uint32_t tdc_then_q8; // when the contact began
    int32_t applied_q16;  // in the tare, or being added to it
    int32_t step_q16;     // what each electrode gets in this sweep
} bt_thermal;

// Counts per TDC count from the setting's thousandths.
int32_t bt_thermal_gain_q16(int32_t gain_milli);

// Take a round's TDC word, or none.
void bt_thermal_add(bt_thermal *thermal, uint16_t tdc, bool end_of_sweep);

// What temperature adds to every electrode in a sweep, at its rate of the last seconds.
int32_t bt_thermal_rate_q16(const bt_thermal *thermal, int32_t gain_q16);

// A tare was adopted: it holds for the present temperature.
void bt_thermal_begin(bt_thermal *thermal);

// After each sweep in contact: sets step_q16, what the coming sweep adds to each electrode.
void bt_thermal_follow(bt_thermal *thermal, int32_t gain_q16);

// How much warmer it is than when the contact began.
#ifndef BT_CDEF
static inline int32_t bt_thermal_warmed_q8(const bt_thermal *thermal)
{
    return (int32_t)(thermal->tdc_q8 - thermal->tdc_then_q8);
}

// Counts of pressure that warmth since then may have made, and that cooling may have taken: one for each of
// TDC, 33 for a degree.
static inline int32_t bt_thermal_warmed_pdc(const bt_thermal *thermal)
{
    return bt_thermal_warmed_q8(thermal) > 0 ? bt_thermal_warmed_q8(thermal) / 256 : 0;
}

static inline int32_t bt_thermal_cooled_pdc(const bt_thermal *thermal)
{
    return bt_thermal_warmed_q8(thermal) < 0 ? -bt_thermal_warmed_q8(thermal) / 256 : 0;
}
#endif

#endif
