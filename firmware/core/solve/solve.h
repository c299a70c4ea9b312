// From signals, counts and tare to point of contact, force and torque.
// Output units are those of the FRAME message: um, 100 uN, mN*mm, rounded half away from zero; a result that
// cannot be given is the type's minimum, never 0 and never an older one.
#ifndef BIOTAC_SOLVE_H
#define BIOTAC_SOLVE_H

#include "keep/settings.h"
#include "map/map.h"
#include "solve/interval.h"
#include "solve/wrench.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// What the kernels need from the settings, looked up once per change.
typedef struct {
    int poc_weights;
    bt_gains gains;
    const bt_map *map;      // used instead of the gains; NULL: none
    bool population;        // without a map, force comes from the population map
    uint32_t warmed_max_q8; // change of TDC that may make the force wrong by WARMED_100UN
} bt_solve_settings;

// Leaves `map` NULL, for the caller to set.
bt_solve_settings bt_solve_settings_from(const bt_settings *settings);

// What to compute; the rest is marked invalid. Torque x needs a point and a force: they are computed for it,
// but given only if wanted.
#define BT_WANT_POC    BT_QUANTITY_FLAG_POC
#define BT_WANT_FORCE  BT_QUANTITY_FLAG_FORCE
#define BT_WANT_TORQUE BT_QUANTITY_FLAG_TORQUE
#define BT_WANT_ALL    (BT_WANT_POC | BT_WANT_FORCE | BT_WANT_TORQUE)

// Results from signals, without a map. Force comes from the gains or, if guess_mn is given, from the
// population map and from what it is mixed with; torque y and z are Eq 4's, and x is derived from that force.
// Returns POC_INVALID if PoC or torque is wanted and there is no PoC; by the population map also POPULATION
// if a force was computed, and OUTSIDE as bt_population_force says. guess_mn then is bt_population_guess's,
// left as it is without a force. The host runs recorded counts through this same function.
uint32_t bt_solve(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t wanted,
                  int16_t poc_um[3], int32_t force_100un[3], int32_t torque_mnmm[3], uint32_t guess_mn[2]);

// The same with settings->map, for a frame whose signals are e_q4. Force comes from the map, and torque if
// the map has it; otherwise torque y and z are Eq 4's, and x is derived from the map's force. Torsion comes
// only from a map, and only if torque is wanted. A map of the population map's blocks is judged as that one:
// its force is mixed, OUTSIDE is returned and the guess written as above. Of any other map: POPULATION where
// the touch is unlike its lesson, so that part of the force is the population map's, with that one's guess
// and OUTSIDE; OUTSIDE if it has no lesson.
typedef struct {
    const uint16_t *counts;    // [BT_ELECTRODES]
    const uint16_t *tare_q4;   // [BT_ELECTRODES]
    int32_t pdc_above_rest_q4; // BT_INVALID_I32: unknown
} bt_map_input;
uint32_t bt_solve_mapped(const int32_t e_q4[BT_ELECTRODES], const bt_map_input *frame,
                         const bt_solve_settings *settings, uint32_t wanted, int16_t poc_um[3],
                         int32_t force_100un[3], int32_t torque_mnmm[3], int32_t *torsion_mnmm,
                         bt_uncertainty *uncertainty);

#endif
