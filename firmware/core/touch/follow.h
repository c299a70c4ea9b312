// Serves a round's lanes: closes their means, and adds up sums for the verdicts after the sweep. At rest the
// tare follows the means, in a touch only temperature and drift.
#ifndef BIOTAC_FOLLOW_H
#define BIOTAC_FOLLOW_H

#include "touch/machine.h"

// Serve a round's lanes, once the words are in the sweep.
void bt_follow_turn(bt_tare *tare);

// Catch up after a silence, all electrodes alike: differences drown in the noise of so few rounds.
void bt_follow_resume(bt_tare *tare);

#endif
