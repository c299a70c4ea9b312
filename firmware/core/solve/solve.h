// From counts and tare to signals, and from signals to point of contact, force and torque.
// Output units are those of the FRAME message: um, 100 uN, mN*mm, rounded half away from zero;
// a result that cannot be given is the type's minimum, never 0 and never an older one.
#ifndef BIOTAC_KERNEL_H
#define BIOTAC_KERNEL_H

#include "keep/settings.h"
#include "map/map.h"
#include "solve/wrench.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

// What the kernels need of the settings, looked up once per change.
typedef struct {
    int poc_weights;
    bt_gains gains;
    uint32_t force_per_count_100un_q16[3]; // by which one count of noise on every electrode moves the force
    const bt_map *map;                     // in force instead of the gains; NULL: none
    bool population;                       // without a map: force comes from the population map
} bt_solve_settings;

// Without a map: that is the caller's to set.
bt_solve_settings bt_solve_settings_from(const bt_settings *settings);

// What to compute. What nobody wants is marked invalid; torque x needs a point and a force, which then
// are computed but not given.
#define BT_WANT_POC    BT_QUANTITY_FLAG_POC
#define BT_WANT_FORCE  BT_QUANTITY_FLAG_FORCE
#define BT_WANT_TORQUE BT_QUANTITY_FLAG_TORQUE
#define BT_WANT_ALL    (BT_WANT_POC | BT_WANT_FORCE | BT_WANT_TORQUE)

// From signals to the results and their invalid marks alone. Returns POC_INVALID or 0, and 0 too when
// neither PoC nor torque is wanted. The host runs recorded counts through this same function.
uint32_t bt_solve(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t wanted,
                  int16_t poc_um[3], int32_t force_100un[3], int32_t torque_mnmm[3]);

// The same where settings->map is in force, of a frame whose signals are e_q4: force, and torque where the
// map has it, come from the map; else torque y and z are Eq 4's, and x is derived from the map's force.
// Torsion is of the map alone, and wanted with torque.
typedef struct {
    const uint16_t *counts;    // [BT_ELECTRODES]
    const uint16_t *tare_q4;   // [BT_ELECTRODES]
    int32_t pdc_above_rest_q4; // BT_INVALID_I32: unknown
} bt_map_input;
uint32_t bt_solve_mapped(const int32_t e_q4[BT_ELECTRODES], const bt_map_input *frame,
                         const bt_solve_settings *settings, uint32_t wanted, int16_t poc_um[3],
                         int32_t force_100un[3], int32_t torque_mnmm[3], int32_t *torsion_mnmm);

// The same without a map, as settings->population says: force of the population map, with the gains' in the
// share that bt_population_share leaves them. Torque y and z are Eq 4's, and x is derived from that force.
// Returns POPULATION too, and OUTSIDE where the gains have a share; neither where there is no force.
uint32_t bt_solve_uncalibrated(const int32_t e_q4[BT_ELECTRODES], const bt_map_input *frame,
                               const bt_solve_settings *settings, uint32_t wanted, int16_t poc_um[3],
                               int32_t force_100un[3], int32_t torque_mnmm[3]);

#endif
