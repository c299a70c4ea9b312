// The lanes whose turn it is: their means are closed, at rest the tare follows them, in a touch it follows
// temperature and what is drift; and what the verdicts after the sweep go by is summed up.
#ifndef BIOTAC_FOLLOW_H
#define BIOTAC_FOLLOW_H

#include "touch/machine.h"

// A round's lanes, once its words are in the sweep.
void bt_follow_turn(bt_tare *tare);

// Back from a silence. All electrodes alike: what each has of its own is less than the noise of so few
// rounds.
void bt_follow_resume(bt_tare *tare);

#endif
