// The population map: a wrench map built into the firmware (population_gen.h), for fingers that nobody has
// calibrated. It holds what other fingers have in common (host/docs/guides/population.md).
//
// It was trained on fingers of one rig, with a flat plate. A touch that is lighter than those, or whose
// pattern is unlike theirs, gets a force along the normals of the compressed electrodes instead: the
// direction that holds on every rig, with a strength that holds roughly.
#ifndef BIOTAC_POPULATION_H
#define BIOTAC_POPULATION_H

#include "map/map.h"

// The map. Its blob begins 4 bytes before `serial`.
extern const bt_map bt_population;

// Force on the finger in 100 uN. e_q4: from bt_signals_q4; counts: 0..4095 or BT_INVALID_COUNT; an electrode
// without a count or a tare has signal 0. No input overflows.
void bt_population_force(const int32_t e_q4[BT_ELECTRODES], const uint16_t counts[BT_ELECTRODES],
                         const uint16_t tare_q4[BT_ELECTRODES], int32_t force_100un[3]);

#define BT_POPULATION_ALL 256
typedef struct {
    uint32_t share;             // of the force that comes from the map, in 1/256
    bool outside;               // nothing touches, or the pattern is unlike any that was tested
    uint32_t strength_100un;    // from the sum of all signals
    int32_t otherwise_100un[3]; // the rest of the force; not written where share is all
} bt_likeness;

// How like the training the signals are: firm, from a sum of |e| of 1500 to 2524 counts, and near, from a
// squared distance of 4 to 8 (SPEC.md, Population map).
bt_likeness bt_population_likeness(const int32_t e_q4[BT_ELECTRODES]);

// Mix the map's force with the rest of it; the result replaces force_100un.
void bt_population_mix(const bt_likeness *its, int32_t force_100un[3]);

// One sigma of the result: in the map's share, the errors on each finger of a map made of the others.
void bt_population_sigma(const bt_likeness *its, uint16_t sigma_100un[3]);

#endif
