#include "touch/inverted.h"

#include "wire/touch_gen.h"

_Static_assert(BT_ELECTRODES *(int64_t)BT_FULL_SCALE_COUNT *BT_FULL_SCALE_COUNT <= INT32_MAX,
               "squares of counts over all electrodes must fit 32 bits");

bool bt_inverted(const bt_lanes *smooth, const bt_baseline *base, int32_t pdc_missing)
{
    int32_t below = (int32_t)(base->pdc_q16 >> 16) - smooth->lane[BT_LANE_PDC];
    if (base->pdc_q16 == BT_TARE_UNKNOWN || below <= pdc_missing) {
        return false;
    }
    uint32_t energy_count2 = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t base_q16 = base->electrode_q16[i];
        if (base_q16 != BT_TARE_UNKNOWN && smooth->lane[i] <= BT_FULL_SCALE_COUNT) {
            int32_t e = smooth->lane[i] - (int32_t)(base_q16 >> 16);
            energy_count2 += (uint32_t)(e * e);
        }
    }
    return energy_count2 > BT_INVERTED_COUNT2;
}
