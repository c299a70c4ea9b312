// The verdicts after a sweep, or after a round that speaks against the tare: has a contact ended, is the tare
// wrong, what was drift? The rules are in release.h and drift.h; here they are applied.
#ifndef BIOTAC_JUDGE_H
#define BIOTAC_JUDGE_H

#include "touch/machine.h"

#define BT_TARE_STILL_SWEEPS 2 // needed for a tare; the first may hold what came before it

// Do filtered counts speak against the tare? Skin is pressed, never pulled: pressure well below rest shows a
// tare that was taken of a hold. pdc_missing: what else may have taken pressure.
bool bt_inverted(const bt_lanes *smooth, const bt_baseline *base, int32_t pdc_missing);

// A round with pressure below the tare.
void bt_judge_inverted(bt_tare *tare);

// A round in contact: is something pressed that no electrode feels?
void bt_judge_felt(bt_tare *tare);

// The sweep is over, all of its lanes were served.
void bt_judge_sweep(bt_tare *tare, const bt_tare_settings *settings);

#endif
