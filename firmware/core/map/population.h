// The population map: a wrench map built into the firmware (population_gen.h), for fingers that nobody has
// calibrated. It holds what other fingers have in common (host/docs/guides/population.md).
//
// It was trained on fingers of one rig, with a flat plate. Another estimate of the force is along the normals
// of the compressed electrodes: a direction that holds on every rig, with a strength that holds roughly. In a
// touch lighter than the training's, and where the two differ by more than they did on fingers left out of
// it, force goes over to the normals.
#ifndef BIOTAC_POPULATION_H
#define BIOTAC_POPULATION_H

#include "map/map.h"

// The map. Its blob begins 4 bytes before `serial`. It needs no counts, tare and PDC.
extern const bt_map bt_population;

#define BT_POPULATION_ALL 256
typedef struct {
    uint32_t share;             // of the force that comes from the map, in 1/256
    uint32_t gain;              // of both, in 1/256: below 1 in a light touch
    bool outside;               // nothing touches, or the map and the normals contradict each other
    uint32_t strength_100un;    // from the sum of all signals
    int32_t otherwise_100un[3]; // along the normals, before the gain
    uint32_t firm_100un;        // the strength before the gain
    bool few;                   // hardly any electrode is compressed
} bt_likeness;

// What the signals say without the map: share is the most that it may have; where that is 0, the rest holds.
bt_likeness bt_population_touch(const int32_t e_q4[BT_ELECTRODES]);

// Else the map's share, and outside, by how far its force is off the normals along the axis where it is most.
// The further, the smaller is the share, and what is outside stays so.
void bt_population_judge(bt_likeness *touch, uint32_t off_100un);

// Force on the finger in 100 uN, of signals as from bt_signals_q4, by the population map or one like it, and
// how like the training they are (SPEC.md, Population map). A touch so light that the map has no share in its
// force does not evaluate it. No input overflows.
bt_likeness bt_population_force(const bt_map *map, const int32_t e_q4[BT_ELECTRODES], int32_t force_100un[3]);

// True for a map of the same blocks: this one fitted to presses of a finger. Beyond them it extrapolates as
// this one does, so it is judged alike.
bool bt_population_like(const bt_map *map);

// The strength of a firm touch by the sum of all signals, before the gain, in 100 uN, at most 303 000.
uint32_t bt_strength_100un(const int32_t e_q4[BT_ELECTRODES]);

#endif
