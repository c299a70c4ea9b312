// Was the tare wrong? Skin is pressed, never pulled. If pressure is well below rest, the finger was tared
// while something touched it.
#ifndef BIOTAC_INVERTED_H
#define BIOTAC_INVERTED_H

#include "touch/baseline.h"

// Do a round's filtered counts speak against the tare? pdc_missing: what else may have taken pressure.
bool bt_inverted(const bt_lanes *smooth, const bt_baseline *base, int32_t pdc_missing);

#endif
