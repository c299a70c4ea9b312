// The population map: a wrench map built into the firmware (population_gen.h), for uncalibrated fingers. It
// holds the common part of other fingers (host/docs/guides/population.md).
//
// It was trained on fingers of one rig, with a flat plate. A second estimate of the force is along the
// normals of the compressed electrodes: the direction holds on every rig, the strength roughly. The force
// goes over to the normals in touches lighter than the training, and where the two estimates differ by more
// than they did on held-out fingers.
#ifndef BIOTAC_POPULATION_H
#define BIOTAC_POPULATION_H

#include "map/map.h"

// The map. The blob begins 4 bytes before `serial`. Counts, tare and PDC are not needed.
extern const bt_map bt_population;

#define BT_POPULATION_ALL 256
typedef struct {
    uint32_t share;             // of the force that comes from the map, in 1/256
    uint32_t gain;              // of both, in 1/256: below 1 in a light touch
    bool outside;               // nothing touches, or the map and the normals contradict each other
    uint32_t strength_100un;    // from the sum of all signals
    int32_t otherwise_100un[3]; // along the normals, before the gain
    uint32_t firm_100un;        // the strength before the gain
    uint32_t off_100un;         // how far the map is from the normals, at most firm_100un; 0: not evaluated
    bool few;                   // hardly any electrode is compressed
} bt_likeness;

// The likeness from signals alone: share is an upper limit; where that is 0, all other fields are final.
bt_likeness bt_population_touch(const int32_t e_q4[BT_ELECTRODES]);

// The map's share, and outside, by the largest distance of the map's force from the normals along any axis.
// The share falls with the distance; outside stays set.
void bt_population_judge(bt_likeness *touch, uint32_t off_100un);

// Force on the finger in 100 uN by the population map or one like it, for signals as from bt_signals_q4, and
// their likeness to the training (SPEC.md, Population map). A touch too light for any share of the map does
// not evaluate it. No input overflows.
bt_likeness bt_population_force(const bt_map *map, const int32_t e_q4[BT_ELECTRODES], int32_t force_100un[3]);

// True for a map of the same blocks: this one fitted to presses of a finger. It extrapolates as this one
// does, so the same limits apply.
bool bt_population_like(const bt_map *map);

// Strength of a firm touch by the sum of all signals, before the gain, in 100 uN, at most 303 000.
uint32_t bt_strength_100un(const int32_t e_q4[BT_ELECTRODES]);

#endif
