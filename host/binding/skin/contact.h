// The load on a simulated finger at n instants, and the point on the core's surface: x to the tip, y to E11's
// side, z dorsal.
#ifndef BIOTAC_CONTACT_H
#define BIOTAC_CONTACT_H

#include <stdint.h>

enum {
    BT_POSE_NUMBERS = 9,     // of timeline.Pose, in order
    BT_CONTACT_NUMBERS = 11, // an instant's of bt_contact
};

// n numbers each, or n rows of 3, by the names and units of physics.States.
typedef struct {
    const double *contact_mm, *force_n, *shear_n, *torsion_nmm, *tip_radius_mm, *warm_c;
    const double *slip_mm_s; // NULL: nothing slides
} bt_contact;

// n rows of a pose to the arrays of a contact, which it puts at ``numbers``, in that order and back to back.
void bt_contact_of_poses(int64_t n, const double *poses, double rest_celsius, double *numbers,
                         bt_contact *contact);

// The outward unit normal of the core at a point of the surface.
void bt_normal_at(const double point_mm[3], double normal[3]);

// Unit vectors towards the tip and towards E11's side in the plane of an outward
// normal: x and y of the frame, turned by the shortest rotation that moves -z to the
// normal.
void bt_tangents_at(const double normal[3], double to_tip[3], double to_side[3]);

// The surface's point that lies nearer to the pad by ``by_mm`` along the surface, and by a share of the roll.
void bt_nearer_to_pad(const double point_mm[3], double by_mm, double roll_share, double moved_mm[3]);

// How far along the surface a point lies, from where the cap begins to the tip.
double bt_along_mm(const double point_mm[3]);

#ifndef BT_CDEF
static inline double bt_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
#endif

#endif
