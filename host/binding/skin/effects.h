// The effect of deformed skin on one simulated finger at an instant, before time and noise.
#ifndef BIOTAC_EFFECTS_H
#define BIOTAC_EFFECTS_H

#include "skin/contact.h"
#include "skin/skin.h"

// A contact, with bt_deform's results for it, or NULL, by which counts are left to another model.
typedef struct {
    const bt_contact *contact;
    const double *compression, *bulge;
} bt_touched;

// A row of sampling.EFFECTS_DTYPE: counts of the electrodes and those above rest, normal force in N, counts
// of pressure and of temperature, and how fast the skin slides.
typedef struct {
    double exact[BT_ELECTRODES], pressed[BT_ELECTRODES];
    double force_n, pressure, tdc, slip_mm_s;
} bt_effects;

// n rows of 19 counts, not rounded, from resistances at rest and sensitivities (19 each), the gap's
// compression and bulge (NULL: at rest), and temperatures in C above the model's reference (NULL: at that).
void bt_skin_counts(const bt_skin *skin, const double *r0_ohm, const double *gap_gain, int64_t n,
                    const double *compression, const double *bulge, const double *warm_c, double *counts);

// The effect of a newton at n points of the core, over that in the middle of the spread.
void bt_loudness(const bt_skin *skin, double tip_gain, double side_gain, int64_t n, const double *contact_mm,
                 double *share);

// Counts of temperature, not rounded, of n temperatures in C.
void bt_tdc_counts(const bt_skin *skin, int64_t n, const double *celsius, double *counts);

// n instants of contacts at once: squeezes and volumes add, and the temperature is the first one's.
void bt_effects_of(const bt_skin *skin, const bt_skin_finger *finger, int64_t n, int32_t contacts,
                   const bt_touched *touched, bt_effects *effects);

#endif
