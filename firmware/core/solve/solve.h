// From signals, counts and tare to point of contact, force and torque. Output units are those of the FRAME
// message: um, 100 uN, mN*mm, rounded half away from zero; a missing result is the type's minimum, never 0
// and never an older one.
#ifndef BIOTAC_SOLVE_H
#define BIOTAC_SOLVE_H

#include "keep/settings.h"
#include "map/map.h"
#include "solve/interval.h"
#include "solve/wrench.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// The settings that the kernels need, looked up once per change.
typedef struct {
    int poc_weights;
    bt_gains gains;
    const bt_map *map;      // used instead of the gains; NULL: none
    bool population;        // without a map, the population map gives the force
    uint32_t warmed_max_q8; // change of TDC that may make the force wrong by WARMED_100UN
    uint32_t count_mn_q8;   // force of a count of pressure: as calibrated, or usual
} bt_solve_settings;

// Leaves `map` NULL, for the caller to set.
bt_solve_settings bt_solve_settings_from(const bt_settings *settings);

// Quantities to compute; all others are marked invalid. Torque x needs a point and a force: they are computed
// for it, but given only if wanted.
#define BT_WANT_POC    BT_QUANTITY_FLAG_POC
#define BT_WANT_FORCE  BT_QUANTITY_FLAG_FORCE
#define BT_WANT_TORQUE BT_QUANTITY_FLAG_TORQUE
#define BT_WANT_ALL    (BT_WANT_POC | BT_WANT_FORCE | BT_WANT_TORQUE)

// Results from signals, without a map. The gains give the force; if uncertainty is given, the population map
// and its mixture do. Torque y and z are Eq 4's, x is derived from that force. Returns POC_INVALID if PoC or
// torque is wanted and there is no PoC; by the population map also POPULATION for a force, and OUTSIDE as
// bt_population_force says. uncertainty's guess_mn and off_100un are then set, unchanged without a force.
// The host runs recorded counts through this same function.
uint32_t bt_solve(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t wanted,
                  int16_t poc_um[3], int32_t force_100un[3], int32_t torque_mnmm[3],
                  bt_uncertainty *uncertainty);

// The same with settings->map, for a frame with the signals e_q4. The map gives the force, and torque if it
// has one; otherwise torque y and z are Eq 4's, and x is derived from the map's force. Only a map gives
// torsion, and only if torque is wanted. A map with the population map's blocks counts as that one: its force
// is mixed, OUTSIDE is returned and the guess written as above. Any other map: POPULATION where the touch is
// unlike the lesson, so that part of the force is the population map's, with that one's guess and OUTSIDE;
// OUTSIDE if the map has no lesson.
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
