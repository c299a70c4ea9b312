// Signals: a channel's reading relative to rest, e = count - tare; compression is negative.
#ifndef BIOTAC_SIGNALS_H
#define BIOTAC_SIGNALS_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdint.h>

// An electrode without a count or without a tare gives 0.
void bt_signals_q4(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                   int32_t e_q4[BT_ELECTRODES]);

// PDC above the tare, BT_INVALID_I32 where either is missing.
int32_t bt_pdc_above_rest_q4(uint16_t pdc, uint16_t pdc_tare_q4);

#endif
