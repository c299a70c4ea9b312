// Serves the lanes whose turn it is: closes their means, and sums up what the verdicts after the sweep need.
// At rest the tare follows the means, in a touch only temperature and drift.
#ifndef BIOTAC_FOLLOW_H
#define BIOTAC_FOLLOW_H

#include "touch/machine.h"

// Serve a round's lanes, once its words are in the sweep.
void bt_follow_turn(bt_tare *tare);

// Catch up after a silence, all electrodes alike: how they differ is lost in the noise of so few rounds.
void bt_follow_resume(bt_tare *tare);

#endif
