// What a sweep says, or a round that speaks against the tare: has a contact begun or ended, is the tare
// wrong, what was drift? The rules are release.h's, inverted.h's and drift.h's; here they are asked and
// obeyed.
#ifndef BIOTAC_JUDGE_H
#define BIOTAC_JUDGE_H

#include "touch/machine.h"

#define BT_STILL_SWEEPS 2 // to tare from; the first one may hold what came before it

// A round with pressure below the tare: one that was taken of a hold shows when that ends.
void bt_judge_inverted(bt_tare *tare);

// The sweep is over, all of its lanes were served.
void bt_judge_sweep(bt_tare *tare, const bt_tare_settings *settings);

#endif
