// The numbers of the simulated fingers' skin, electrodes and core, as host/biotac/sim states and explains
// them: C has none of its own. Lengths in mm on the core of Lin 2013, forces in N, angles in rad.
#ifndef BIOTAC_SKIN_H
#define BIOTAC_SKIN_H

#include "wire/sensor_gen.h"

#include <stdint.h>

// A point of the core's surface: an electrode, or one of those over which volumes are summed.
typedef struct {
    double at_mm[3], at2_mm2; // and the square of the distance from the origin
    double radial[3];         // outward unit normal
    double area_mm2;          // 0 for an electrode
} bt_skin_point;

typedef struct {
    // The numbers that fingers have in common (skin.json), by the names of physics.Skin.
    double along_mm, across_mm, squeeze, exponent, growth, taper, fixed_share, bulge_share, hole;
    double drag_along_n_mm, drag_across_n_mm, drag_max_mm, drag_reach_mm, pile_per_mm2, lead_mm, lead_roll;
    double gain[4][BT_ELECTRODES]; // of squeeze, bulge, drag and pile-up

    // The constants of physics.py, by name.
    double gap_mm, plate_mm, plate_n, faint_n, pad_mm, pad_reach_mm, skin_mm;
    double lead_at_mm, lead_reach_mm, lead_from_mm, squeeze_max_per_n, torsion_nmm_per_rad, torsion_max_rad;
    double tip_from, side_from, side_to, squeeze_max, temperature_per_c, rest_celsius;

    // The divider's and the thermistor's of sensor.toml.
    double load_ohm, tdc_a, tdc_b, tdc_beta_k;

    int32_t points;             // the electrodes, and then the mesh
    const bt_skin_point *point; // of so many
} bt_skin;

// A finger of the population, by the names of physics.Finger: 19 numbers each, and one.
typedef struct {
    const double *r0_ohm, *gap_gain, *drift_per_min;
    double creep_share, pdc_rest, pdc_per_n, tip_gain, side_gain, rattle_per_n_s, noise_counts, glitch_share;
} bt_skin_finger;

#endif
