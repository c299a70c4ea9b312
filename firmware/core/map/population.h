// The population map: the force on a finger that nobody has calibrated, by what other fingers have in common
// (host/docs/population.md): a wrench map that the firmware carries, population_gen.h.
//
// It was learnt on a flat plate. Where few electrodes carry the signal, a poke or an edge, it does not know
// what it says: there bt_population_share tells the caller to take Lin's pull instead, which keeps the sign
// and the order of size.
#ifndef BIOTAC_POPULATION_H
#define BIOTAC_POPULATION_H

#include "map/map.h"

// The map itself, of so many bytes from 4 before its serial number on.
const bt_map *bt_population_map(size_t *bytes);

// Force in 100 uN on the finger. e_q4: of bt_signals_q4; counts: 0..4095 or BT_INVALID_COUNT; an electrode
// without a count or without a tare counts as signal 0. No input overflows.
void bt_population_force(const int32_t e_q4[BT_ELECTRODES], const uint16_t counts[BT_ELECTRODES],
                         const uint16_t tare_q4[BT_ELECTRODES], int32_t force_100un[3]);

// With s = |e| without its first 8 counts, which are noise: how much of the force the map should make, in
// 1/256: all of it where the signal, (sum s)^2 / sum s^2, spreads over 4.5 electrodes or more, as it does
// wherever a flat plate was pressed (4.8 in the least of 46 000 frames of two fingers); nothing where it
// spreads over three or fewer; in between in proportion.
uint32_t bt_population_share(const int32_t e_q4[BT_ELECTRODES]);
#define BT_POPULATION_ALL 256

// One sigma of the map's force on a finger that it was not made of, in 100 uN: what maps of the other fingers
// left on each, so that it holds noise too.
extern const uint16_t bt_population_sigma_100un[3];

// A map's force and Lin's in these shares, in place of force_100un. share <= BT_POPULATION_ALL.
void bt_population_mix(uint32_t share, const int32_t lin_100un[3], int32_t force_100un[3]);

#endif
