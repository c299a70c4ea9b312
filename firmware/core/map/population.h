// The population map: a wrench map built into the firmware (population_gen.h), for fingers that nobody has
// calibrated. It holds what other fingers have in common (host/docs/population.md).
//
// It was trained with a flat plate, and is unreliable where few electrodes carry the signal, as when a point
// or an edge presses. There bt_population_share tells the caller to use Lin's formula instead, which gets the
// sign and the order of magnitude right.
#ifndef BIOTAC_POPULATION_H
#define BIOTAC_POPULATION_H

#include "map/map.h"

// The map. Its blob begins 4 bytes before `serial`.
extern const bt_map bt_population;

// Force on the finger in 100 uN. e_q4: from bt_signals_q4; counts: 0..4095 or BT_INVALID_COUNT; an electrode
// without a count or a tare has signal 0. No input overflows.
void bt_population_force(const int32_t e_q4[BT_ELECTRODES], const uint16_t counts[BT_ELECTRODES],
                         const uint16_t tare_q4[BT_ELECTRODES], int32_t force_100un[3]);

// How much of the force should come from the map, in 1/256. It depends on how many electrodes the signal
// spreads over, (sum s)^2 / sum s^2, where s is |e| less its first 8 counts, which are noise: all from 4.5
// electrodes on, as always under a flat plate (at least 4.8 in 46 000 frames of two fingers); none up to
// three; in between in proportion.
uint32_t bt_population_share(const int32_t e_q4[BT_ELECTRODES]);
#define BT_POPULATION_ALL 256

// One sigma, in 100 uN, of the map's force on a finger that it was not trained on: the errors on each finger
// of a map made of the others, so it includes noise.
extern const uint16_t bt_population_sigma_100un[3];

// Mix the map's force and Lin's in these shares; the result replaces force_100un. share <= BT_POPULATION_ALL.
void bt_population_mix(uint32_t share, const int32_t lin_100un[3], int32_t force_100un[3]);

#endif
