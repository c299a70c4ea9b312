#include "signal/leap.h"

#include "fixed_point.h"

#include <string.h>

#define TDC_LEAP 64   // two degrees
#define ALIKE    608  // in sum, 32 each
#define FAR      1216 // in sum, with pressure's
#define PRESSURE 4    // so often pressure counts
#define SWINGS   16   // so many swings of PAC a blow's sum is less than

static bool pac_swings(const uint16_t *pac, uint32_t swing)
{
    uint16_t least = UINT16_MAX, most = 0;
    for (unsigned k = 0; k < BT_PAC_PER_FRAME; k++) {
        if (!bt_count_usable(pac[k])) {
            return true; // nobody knows
        }
        least = pac[k] < least ? pac[k] : least;
        most = pac[k] > most ? pac[k] : most;
    }
    return most == least || (uint32_t)(most - least) >= swing; // one that has died says nothing
}

// Measure how far the words leapt that the filter holds back until the next round.
static void measure(bt_leap *leap, const bt_round *round, const bt_lanes *smooth, uint32_t held)
{
    uint32_t total = 0, top = 0;
    int32_t along = 0;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        if (held >> i & 1) {
            int32_t move = round->electrode[i] - smooth->lane[i];
            uint32_t size = bt_abs32(move);
            total += size;
            along += move;
            top = size > top ? size : top;
        }
    }
    bool alike = bt_abs32(along) >= total - total / 8 && BT_ELECTRODES * top < 2 * total;
    bool pressed = held >> BT_LANE_PDC & 1;
    leap->alike = total >= ALIKE && alike && !pressed;
    if (pressed) {
        total += PRESSURE * bt_abs32(round->pdc - smooth->lane[BT_LANE_PDC]);
    }
    leap->swing = (uint16_t)(total >= FAR ? total / SWINGS : 0);
}

static bool tdc_leaps(bt_leap *leap, uint16_t tdc)
{
    uint16_t read = bt_count_usable(tdc) ? tdc : 0;
    bool far = read != 0 && leap->tdc != 0 && bt_abs32(read - leap->tdc) > TDC_LEAP;
    bool confirmed = far && leap->tdc_leapt;
    leap->tdc_leapt = far && !confirmed;
    leap->tdc = leap->tdc_leapt ? leap->tdc : read;
    return confirmed;
}

uint8_t bt_leap_round(bt_leap *leap, const bt_round *round, const bt_trigger *trigger)
{
    bool lasts = !bt_usable_without(trigger->far & trigger->far_before & BT_ALL_ELECTRODES);
    bool exchanged = lasts && leap->swing != 0 && !pac_swings(round->pac, leap->swing);
    bool together = lasts && leap->alike;
    uint32_t used = (BT_ALL_ELECTRODES & ~trigger->without) | (uint32_t)trigger->pressure_now << BT_LANE_PDC;
    uint32_t held = trigger->far & ~trigger->far_before & leap->read & used;
    leap->read = used;
    leap->swing = 0;
    leap->alike = false;
    if (!bt_usable_without(held & BT_ALL_ELECTRODES)) {
        measure(leap, round, &trigger->smooth, held);
        if (pac_swings(leap->pac, leap->swing) || pac_swings(round->pac, leap->swing)) {
            leap->swing = 0;
        }
    }
    memcpy(leap->pac, round->pac, sizeof leap->pac);
    if (tdc_leaps(leap, round->tdc) || exchanged) {
        return BT_SENSOR_FAULT_EXCHANGED;
    }
    return together ? BT_SENSOR_FAULT_TOGETHER : BT_SENSOR_FAULT_NONE;
}
