#include "signal/leap.h"

#include "fixed_point.h"
#include "signal/moves.h"

#include <string.h>

#define TDC_LEAP   64   // two degrees
#define PDC_ALIKE  12   // another sensor's pressure is hundreds of counts away
#define PAC_ACTIVE 48   // far above a quiet PAC's noise
#define ALIKE      608  // sum over the electrodes: 32 each
#define FAR        1216 // sum over the electrodes and PRESSURE times pressure
#define PRESSURE   4    // weight of pressure in that sum
#define SWINGS     16   // a blow's sum is less than so many swings of PAC

static bool pac_swings(const uint16_t *pac, uint32_t swing)
{
    uint16_t least = UINT16_MAX, most = 0;
    for (unsigned k = 0; k < BT_PAC_PER_FRAME; k++) {
        if (!bt_count_usable(pac[k])) {
            return true; // a missing word may have swung
        }
        least = pac[k] < least ? pac[k] : least;
        most = pac[k] > most ? pac[k] : most;
    }
    return most == least || (uint32_t)(most - least) >= swing; // constant: a dead PAC, or one at a rail
}

static bool swung(uint16_t first, uint16_t second)
{
    return bt_count_usable(first) && bt_count_usable(second) && bt_abs32(first - second) > PAC_ACTIVE;
}

// Measure how far the words leapt that the filter holds back for a round.
static void measure(bt_leap *leap, const bt_round *round, const bt_lanes *smooth, uint32_t far)
{
    bt_lanes now = *smooth;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        now.lane[i] = far >> i & 1 ? round->electrode[i] : now.lane[i];
    }
    bt_moves moves = bt_moves_between(&now, smooth);
    uint32_t total = moves.total;
    bool aligned = bt_abs32(moves.along) >= total - total / 8;
    bool pressed = far >> BT_LANE_PDC & 1;
    leap->alike = total >= ALIKE && aligned && BT_ELECTRODES * moves.top < 2 * total && !pressed;
    if (pressed) { // unpressed: stuck skin may have snapped back
        total += PRESSURE * bt_abs32(round->pdc - smooth->lane[BT_LANE_PDC]);
        leap->swing = (uint16_t)(total >= FAR && leap->pac_active ? total / SWINGS : 0);
    }
}

static bool tdc_leaps(bt_leap *leap, uint16_t tdc, uint16_t pdc)
{
    if (!bt_count_usable(tdc)) {
        leap->settled = (uint8_t)(leap->settled - (leap->settled != 0));
        return false;
    }
    bool near = bt_abs32(tdc - leap->tdc) <= TDC_LEAP;
    if (!near && leap->settled == BT_LEAP_ROUNDS && ++leap->off < BT_LEAP_ROUNDS) {
        return false;
    }
    bool leaps = leap->off == BT_LEAP_ROUNDS;
    leap->pdc = near ? pdc : leap->pdc;
    leap->tdc = tdc;
    leap->off = 0;
    leap->settled = (uint8_t)(near ? leap->settled + (leap->settled < BT_LEAP_ROUNDS) : 0);
    return leaps;
}

uint8_t bt_leap_round(bt_leap *leap, const bt_round *round, const bt_trigger *trigger)
{
    if (round->t_us - leap->t_us > BT_FRAME_MS * 1500u) {
        bool pac_active = leap->pac_active;
        memset(leap, 0, sizeof *leap);
        leap->pac_active = pac_active;
    }
    uint32_t stays = trigger->far & trigger->far_before;
    bool lasts = !bt_usable_without(stays & BT_ALL_ELECTRODES);
    bool exchanged =
        lasts && stays >> BT_LANE_PDC & 1 && leap->swing != 0 && !pac_swings(round->pac, leap->swing);
    bool together = lasts && leap->alike;
    uint32_t far = trigger->far & leap->read;
    leap->t_us = round->t_us;
    leap->read = (BT_ALL_ELECTRODES & ~trigger->without) | (uint32_t)trigger->pressure_now << BT_LANE_PDC;
    leap->swing = 0;
    leap->alike = false;
    const bool leapt = !bt_usable_without(far & BT_ALL_ELECTRODES) && leap->rounds == BT_LEAP_ROUNDS;
    if (leapt) {
        measure(leap, round, &trigger->smooth, far);
        if (pac_swings(leap->pac, leap->swing) || pac_swings(round->pac, leap->swing)) {
            leap->swing = 0;
        }
    }
    memcpy(leap->pac, round->pac, sizeof leap->pac);
    leap->rounds = bt_count_up(leap->rounds, BT_LEAP_ROUNDS);
    leap->pac_active = leap->pac_active || swung(round->pac[0], round->pac[BT_PAC_PER_FRAME / 2]);
    const uint16_t pdc = trigger->smooth.lane[BT_LANE_PDC];
    bool leaps = tdc_leaps(leap, round->tdc, pdc);
    leap->pending = leap->alike || leap->swing != 0 || (leap->off != 0 && (leapt || leap->pending));
    if ((leaps && bt_abs32(pdc - leap->pdc) > PDC_ALIKE) || exchanged) {
        return BT_SENSOR_FAULT_EXCHANGED;
    }
    return together || leaps ? BT_SENSOR_FAULT_TOGETHER : BT_SENSOR_FAULT_NONE;
}
