// What a grip needs of a force: the part that presses into the skin, the part across it, and how far either
// may be off (SPEC.md, Grip).
//
// n is the skin's outward normal at the point of contact, c / r (on the cylinder without x). Force acts on
// the finger, so a press is along -n: normal = -F n, shear = |F + normal n|. No skin pulls: where -F n is
// negative the published normal is 0.
//
// An interval is made of what its causes add to its half width, in mN:
//
// - margin: what the force's source left on frames that it had not seen, so much and a share of the force
// - guess: what is not known of this touch, most of all by Lin's gains and away from the map's training
// - shear: twice as much as it exceeds the largest of a map's lesson, and of the normal at least a quarter
// - unfelt: pulls and light touches, of which the population map feels too little, and presses at the tip; as
//   far as pressure allows
// - noise: of the electrodes, at rest
// - out: a share of the force for each electrode whose signal is estimated
// - tare: a hold that may be in a tare which nothing has confirmed
//
// Units: mN, rounded to nearest; a component of the force saturates at 37 N, a half width at 65.534 N.
#ifndef BIOTAC_INTERVAL_H
#define BIOTAC_INTERVAL_H

#include "map/map.h"
#include "wire/messages_gen.h"

#include <stdbool.h>
#include <stdint.h>

#define BT_GRIP_MAX_MN 37000 // a component of the force

typedef struct {
    const bt_margin *margin;
    bt_margin of_touch;    // a margin that is this touch's alone
    uint32_t guess_mn[2];  // normal, shear
    uint32_t shear_max_mn; // that the source knows, 0: any
    uint32_t off_100un;    // by the population map: how far it is from the normals (bt_likeness)
    int32_t pressed_mn;    // without an own map: the force that usually makes the pressure; below 0: unknown
    uint32_t noise_q4;     // one standard deviation of an electrode's counts
    uint32_t out;          // electrodes
    bool tare_unconfirmed;
} bt_uncertainty;

// The margin of Lin's gains, fitted to another finger of the same kind, and what is not known of a touch
// whose electrodes' sum is strength_100un (map/population.h): bulges read as pulls, and hide up to 4 N.
extern const bt_margin bt_lin_margin;
void bt_lin_guess(uint32_t strength_100un, uint32_t guess_mn[2]);

// What the population map adds where it is not sure of a touch.
void bt_population_guess(uint32_t share, bool outside, uint32_t strength_100un, uint32_t guess_mn[2]);

// Fill in msg's normal, shear and half widths from its poc_um and force_100un.
void bt_grip(const bt_uncertainty *uncertainty, bt_msg_frame *msg);

void bt_grip_unknown(bt_msg_frame *msg);

#endif
