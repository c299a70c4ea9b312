#include "signal/signals.h"

#include <stdbool.h>

void bt_signals_q4(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                   int32_t e_q4[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool missing = counts[i] == BT_INVALID_COUNT || tare_q4[i] == BT_INVALID_COUNT;
        e_q4[i] = missing ? 0 : 16 * (int32_t)counts[i] - tare_q4[i];
    }
}

int32_t bt_pdc_above_rest_q4(uint16_t pdc, uint16_t pdc_tare_q4)
{
    bool missing = pdc == BT_INVALID_COUNT || pdc_tare_q4 == BT_INVALID_COUNT;
    return missing ? BT_INVALID_I32 : 16 * (int32_t)pdc - pdc_tare_q4;
}
