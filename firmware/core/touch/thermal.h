// What temperature does to the tare of a touched finger. A warmer fluid conducts better, so every count at
// rest rises; while a contact freezes the tare, it follows the sensor's own thermometer (TDC).
//
// All electrodes follow by the same counts. On real fingers TDC alone does not tell all (gradients in the
// core), which is why a degree of change is flagged.
//
// Units: TDC counts in 1/256 (q8), electrode counts in 1/65536 (q16). Products round towards zero.
#ifndef BIOTAC_THERMAL_H
#define BIOTAC_THERMAL_H

#include <stdbool.h>
#include <stdint.h>

#define BT_WARMED_Q8 (33u << 8) // one degree: 30 degrees read about 1000 counts, 31 about 1033

typedef struct {
    uint32_t tdc_q8;      // low-passed over eight sweeps; 0 until read
    int32_t slow_q14;     // the same over 128 more
    uint32_t tdc_then_q8; // when the contact began
    int32_t applied_q16;  // in the tare, or being added to it
    int32_t step_q16;     // what each electrode gets in this sweep
} bt_thermal;

// Counts per TDC count from the setting's thousandths.
int32_t bt_thermal_gain_q16(int32_t gain_milli);

// A round's TDC word, or none; taken in at the end of a sweep.
void bt_thermal_add(bt_thermal *thermal, uint16_t tdc, bool end_of_sweep);

// What temperature, by its pace of the last seconds, adds to every electrode in a sweep.
int32_t bt_thermal_rate_q16(const bt_thermal *thermal, int32_t gain_q16);

// A tare was adopted: it holds for the temperature of now.
void bt_thermal_begin(bt_thermal *thermal);

// After each sweep in contact: step_q16 is what the coming sweep has to add to each electrode.
void bt_thermal_follow(bt_thermal *thermal, int32_t gain_q16);

// By more than a degree since the contact began.
#ifndef BT_CDEF
static inline bool bt_thermal_warmed(const bt_thermal *thermal)
{
    return thermal->tdc_q8 - thermal->tdc_then_q8 + BT_WARMED_Q8 > 2 * BT_WARMED_Q8;
}
#endif

#endif
