#include "skin/deform.h"

#include <math.h>
#include <string.h>

// One contact at one instant.
typedef struct {
    const double *contact_mm, *shear_n;
    double force_n, torsion_nmm;
    double normal[3], to_tip[3], to_side[3]; // at the contact
    double middle_mm[3];                     // of the footprint
    double middle2_mm2, facing[3];           // the square of that, and the normal there
    const double *along;                     // the footprint's long axis
    double middle_along_mm, long2_mm2, short2_mm2;
    double strength;
} load;

// The effect of a contact at a point, per newton where a name says so.
typedef struct {
    double distance2_mm2, outside, under, facing;
} reach;

// How wide a probe of that half width presses, as a share of a plate.
static double probe(const bt_skin *skin, double half_mm)
{
    return (fmin(half_mm, skin->plate_mm) + skin->skin_mm) / (skin->plate_mm + skin->skin_mm);
}

static void middle(const bt_skin *skin, double half_mm, load *load)
{
    double flat = fmin(fmax((half_mm - skin->lead_from_mm) / (skin->plate_mm - skin->lead_from_mm), 0), 1);
    double past = (bt_along_mm(load->contact_mm) - skin->lead_at_mm) / skin->lead_reach_mm;
    double by_mm = skin->lead_mm * flat * exp(-(past * past));
    bt_nearer_to_pad(load->contact_mm, by_mm, skin->lead_roll * flat, load->middle_mm);
    bt_normal_at(load->middle_mm, load->facing);
}

static load load_of(const bt_skin *skin, const bt_footprints *footprints, const bt_contact *contact,
                    int64_t k)
{
    load now = {.contact_mm = contact->contact_mm + 3 * k,
                .shear_n = contact->shear_n + 3 * k,
                .force_n = contact->force_n[k],
                .torsion_nmm = contact->torsion_nmm[k]};
    double long_mm, short_mm;
    bt_normal_at(now.contact_mm, now.normal);
    bt_tangents_at(now.normal, now.to_tip, now.to_side);
    memcpy(now.middle_mm, now.contact_mm, sizeof now.middle_mm);
    memcpy(now.facing, now.normal, sizeof now.facing);
    if (footprints == NULL) {
        double half_mm = contact->tip_radius_mm[k], share = probe(skin, half_mm);
        long_mm = share * skin->along_mm;
        short_mm = share * skin->across_mm;
        middle(skin, half_mm, &now);
    } else {
        double round_mm = sqrt(skin->along_mm * skin->across_mm);
        long_mm = probe(skin, footprints->long_mm[k]) * round_mm;
        short_mm = probe(skin, footprints->short_mm[k]) * round_mm;
    }
    now.along = footprints == NULL ? NULL : footprints->along + 3 * k;
    double grown = pow(fmax(now.force_n, skin->faint_n) / skin->plate_n, skin->growth);
    now.long2_mm2 = long_mm * grown * (long_mm * grown);
    now.short2_mm2 = short_mm * grown * (short_mm * grown);
    double firm = exp(skin->taper * tanh((now.contact_mm[0] - skin->pad_mm) / skin->pad_reach_mm));
    now.strength = pow(now.force_n, skin->exponent) * firm;
    now.middle2_mm2 = bt_dot(now.middle_mm, now.middle_mm);
    return now;
}

static reach reach_of(const bt_skin *skin, const load *load, const double along[3],
                      const bt_skin_point *point)
{
    // The rounding of a distance of 0 decides a count in some 10 000, as squeeze falls off like a cone: the
    // products are fused, so that every machine rounds alike.
    const double *at = point->at_mm, *middle = load->middle_mm;
    double twice = fma(2 * middle[2], at[2], fma(2 * middle[1], at[1], 2 * middle[0] * at[0]));
    double distance2 = fmax(load->middle2_mm2 + point->at2_mm2 - twice, 0);
    double part = bt_dot(along, at) - load->middle_along_mm, part2 = part * part;
    double away2 = part2 / load->long2_mm2 + fmax(distance2 - part2, 0) / load->short2_mm2; // in footprints
    return (reach){.distance2_mm2 = distance2,
                   .outside = away2 > 40 * skin->hole ? 1 : 1 - exp(away2 / -skin->hole), // as 1 - e^-40 is 1
                   .under = load->strength * exp(-sqrt(away2)),
                   .facing = skin->squeeze * fmax(bt_dot(load->facing, point->radial), 0)};
}

// The drag of the skin in mm, to the tip and to the side.
static void drag(const bt_skin *skin, const load *load, double *to_tip_mm, double *to_side_mm)
{
    double x = bt_dot(load->shear_n, load->to_tip) / skin->drag_along_n_mm;
    double y = bt_dot(load->shear_n, load->to_side) / skin->drag_across_n_mm;
    double length_mm = fmax(hypot(x, y), 1e-12);
    double limited = skin->drag_max_mm * tanh(length_mm / skin->drag_max_mm) / length_mm;
    *to_tip_mm = limited * x;
    *to_side_mm = limited * y;
}

static void deform(const bt_skin *skin, load *load, double *compression, double *bulge)
{
    const double *along = load->along == NULL ? load->to_tip : load->along;
    reach near[BT_ELECTRODES];
    double volume_mm3 = 0, room_mm2 = 0, tip_mm, side_mm, turned[3];
    load->middle_along_mm = bt_dot(along, load->middle_mm);
    for (int32_t k = 0; k < BT_ELECTRODES; k++) {
        near[k] = reach_of(skin, load, along, &skin->point[k]);
    }
    for (int32_t k = BT_ELECTRODES; k < skin->points; k++) {
        reach there = reach_of(skin, load, along, &skin->point[k]);
        volume_mm3 += (1 - exp(-there.under * there.facing)) * skin->point[k].area_mm2;
        room_mm2 += there.outside * skin->point[k].area_mm2;
    }
    double widened = skin->bulge_share * volume_mm3 / room_mm2;
    double angle =
        skin->torsion_max_rad * tanh(load->torsion_nmm / (skin->torsion_nmm_per_rad * skin->torsion_max_rad));
    drag(skin, load, &tip_mm, &side_mm);
    for (int d = 0; d < 3; d++) {
        turned[d] = angle * load->normal[d];
    }
    for (int e = 0; e < BT_ELECTRODES; e++) {
        const double *at = skin->point[e].at_mm, *c = load->contact_mm;
        const double arm[3] = {at[0] - c[0], at[1] - c[1], at[2] - c[2]};
        const double moved[3] = {
            tip_mm * load->to_tip[0] + side_mm * load->to_side[0] + turned[1] * arm[2] - turned[2] * arm[1],
            tip_mm * load->to_tip[1] + side_mm * load->to_side[1] + turned[2] * arm[0] - turned[0] * arm[2],
            tip_mm * load->to_tip[2] + side_mm * load->to_side[2] + turned[0] * arm[1] - turned[1] * arm[0]};
        double most = skin->squeeze_max_per_n;
        double outward_mm = bt_dot(moved, skin->point[e].radial), ahead_mm = bt_dot(load->to_tip, arm);
        double sideways = outward_mm / skin->gap_mm * skin->gain[2][e]
                          + skin->pile_per_mm2 * tip_mm * ahead_mm * skin->gain[3][e];
        double fades = exp(near[e].distance2_mm2 / (-2 * skin->drag_reach_mm * skin->drag_reach_mm));
        compression[e] = near[e].under * (most * tanh(near[e].facing * (skin->gain[0][e] / most)));
        bulge[e] = widened * near[e].outside * skin->gain[1][e] + sideways * fades;
    }
}

static int alike(const double *numbers, int64_t k, int width)
{
    return numbers == NULL
           || memcmp(numbers + k * width, numbers + (k - 1) * width, (size_t)width * sizeof *numbers) == 0;
}

static int as_before(const bt_footprints *shape, const bt_contact *contact, int64_t k)
{
    return k > 0 && alike(contact->contact_mm, k, 3) && alike(contact->force_n, k, 1)
           && alike(contact->shear_n, k, 3) && alike(contact->torsion_nmm, k, 1)
           && alike(contact->tip_radius_mm, k, 1)
           && (shape == NULL
               || (alike(shape->short_mm, k, 1) && alike(shape->long_mm, k, 1) && alike(shape->along, k, 3)));
}

void bt_deform(const bt_skin *skin, const bt_footprints *footprints, int64_t n, const bt_contact *contact,
               double *compression, double *bulge)
{
    const size_t row = BT_ELECTRODES * sizeof *bulge;
    for (int64_t k = 0; k < n; k++, compression += BT_ELECTRODES, bulge += BT_ELECTRODES) {
        if (!(contact->force_n[k] > 0)) {
            memset(compression, 0, row);
            memset(bulge, 0, row);
        } else if (as_before(footprints, contact, k)) {
            memcpy(compression, compression - BT_ELECTRODES, row);
            memcpy(bulge, bulge - BT_ELECTRODES, row);
        } else {
            load now = load_of(skin, footprints, contact, k);
            deform(skin, &now, compression, bulge);
        }
    }
}
