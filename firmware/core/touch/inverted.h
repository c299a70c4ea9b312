// Was the tare wrong? Skin is pressed, never pulled. If pressure is well below rest, the finger was tared
// while something touched it.
#ifndef BIOTAC_INVERTED_H
#define BIOTAC_INVERTED_H

#include "touch/baseline.h"

// Whether a round's filtered counts speak against the tare. pdc_peak: the most that pressure has been above
// it; colder: so much that pressure may have fallen by itself.
bool bt_inverted(const bt_lanes *smooth, const bt_baseline *base, int32_t pdc_peak, bool colder);

#endif
