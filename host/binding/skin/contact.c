#include "skin/contact.h"

#include "wire/sensor_gen.h"

#include <math.h>

static const double radius_mm = BT_CORE_RADIUS_UM / 1000.0;

static void on_surface(double x_mm, double y_mm, double point_mm[3])
{
    double ahead_mm = fmax(x_mm, 0);
    double squared = radius_mm * radius_mm - ahead_mm * ahead_mm - y_mm * y_mm;
    point_mm[0] = x_mm;
    point_mm[1] = y_mm;
    point_mm[2] = -sqrt(fmax(squared, 0)); // z = 0 is on the surface; rounding must not turn it into NaN
}

void bt_normal_at(const double point_mm[3], double normal[3])
{
    double radial[3] = {fmax(point_mm[0], 0), point_mm[1], point_mm[2]};
    double length_mm = sqrt(bt_dot(radial, radial));
    for (int d = 0; d < 3; d++) {
        normal[d] = radial[d] / length_mm;
    }
}

void bt_tangents_at(const double normal[3], double to_tip[3], double to_side[3])
{
    const double x = normal[0], y = normal[1], z = normal[2];
    double share = 1 / (1 - z); // singular at z = 1 only: dorsal, never a contact
    to_tip[0] = 1 - x * x * share;
    to_tip[1] = to_side[0] = -x * y * share;
    to_tip[2] = x;
    to_side[1] = 1 - y * y * share;
    to_side[2] = y;
}

double bt_along_mm(const double point_mm[3])
{
    double x = point_mm[0];
    return x > 0 ? radius_mm * asin(fmin(x / radius_mm, 1)) : x;
}

void bt_nearer_to_pad(const double point_mm[3], double by_mm, double roll_share, double moved_mm[3])
{
    double along_mm = bt_along_mm(point_mm) - by_mm;
    double roll = (1 - roll_share) * atan2(point_mm[1], -point_mm[2]);
    double cap = fmax(along_mm, 0) / radius_mm, ring_mm = radius_mm * cos(cap);
    moved_mm[0] = along_mm > 0 ? radius_mm * sin(cap) : along_mm;
    moved_mm[1] = ring_mm * sin(roll);
    moved_mm[2] = -ring_mm * cos(roll);
}

void bt_contact_of_poses(int64_t n, const double *poses, double rest_celsius, double *numbers,
                         bt_contact *contact)
{
    double *contact_mm = numbers, *force_n = contact_mm + 3 * n, *shear_n = force_n + n;
    double *torsion_nmm = shear_n + 3 * n, *tip_radius_mm = torsion_nmm + n, *warm_c = tip_radius_mm + n,
           *slip_mm_s = warm_c + n;
    for (int64_t k = 0; k < n; k++, poses += BT_POSE_NUMBERS) {
        double normal[3], to_tip[3], to_side[3];
        on_surface(poses[0], poses[1], contact_mm + 3 * k);
        bt_normal_at(contact_mm + 3 * k, normal);
        bt_tangents_at(normal, to_tip, to_side);
        const double touched = poses[2] > 0;
        force_n[k] = poses[2];
        for (int d = 0; d < 3; d++) {
            shear_n[3 * k + d] = touched * (poses[3] * to_tip[d] + poses[4] * to_side[d]);
        }
        torsion_nmm[k] = touched * poses[5];
        tip_radius_mm[k] = poses[6] / 2;
        warm_c[k] = poses[7] - rest_celsius;
        slip_mm_s[k] = touched * poses[8];
    }
    *contact = (bt_contact){contact_mm, force_n, shear_n, torsion_nmm, tip_radius_mm, warm_c, slip_mm_s};
}
