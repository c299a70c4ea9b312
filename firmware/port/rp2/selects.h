// The pin of each finger's chip select.
#ifndef BIOTAC_RP2_SELECTS_H
#define BIOTAC_RP2_SELECTS_H

#include "pins.h"
#include "wire/sensor_gen.h"

#include <stdint.h>

_Static_assert(BT_MAX_FINGERS == 5, "as many chip selects as fingers");
static const uint8_t select_pin[BT_MAX_FINGERS] = {PIN_SELECT_0, PIN_SELECT_1, PIN_SELECT_2, PIN_SELECT_3,
                                                   PIN_SELECT_4};

#endif
