// The effect of contacts on the fluid gap over the electrodes; the formulas are in
// host/docs/reference/sensor_model.md.
#ifndef BIOTAC_DEFORM_H
#define BIOTAC_DEFORM_H

#include "skin/contact.h"
#include "skin/skin.h"

// Contacts that are not round: half lengths of an elliptic Gaussian's axes (n each), and the unit vector of
// the long one (n rows of 3).
typedef struct {
    const double *short_mm, *long_mm, *along;
} bt_footprints;

// n rows of 19, each: log compression and log bulge of the gap, 0 without contact. footprints replace the
// contact's tip radius; NULL: it is round. An instant like the one before is not computed again.
void bt_deform(const bt_skin *skin, const bt_footprints *footprints, int64_t n, const bt_contact *contact,
               double *compression, double *bulge);

#endif
