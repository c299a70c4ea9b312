// Compares a touch with the lesson, the touches that a map was fitted to, by the map's own parts. Outside the
// lesson a map extrapolates, and its blocks then part from each other as they never did inside: pairs that
// make half of the force on the pad make twice of it on the flank.
//
// Nine features: the parts of the force that come from pairs of signals and of conductances, over the force's
// size; how far along the centroid of the compression is, and the square of how far across (gates x and y^2);
// and how far the compression extends along, its second moment less half of x^2. For one contact that is
// nearly a straight line in x; two contacts lie above it. Six combinations of the features less their means,
// those that hardly vary in the lesson, are scaled to one size and summed in square, as in a Mahalanobis
// distance: below 1 for all but a few of a hundred frames of a lesson. Only that square is divided by the
// size: the size itself is the first of ten factors, with the means in the weights.
//
// No input overflows: bt_map_open bounds every row's weights.
#ifndef BIOTAC_LESSON_H
#define BIOTAC_LESSON_H

#include "map/lesson_limits.h"
#include "map/map.h"

#define BT_LESSON_ALL 256
typedef struct {
    uint32_t share; // of the force that comes from the map, in 1/256; the population map gives the rest
    uint32_t apart; // of the population map's margin on the lesson that adds to the map's own, in 1/256
} bt_lesson_verdict;

// The factors of a map's result for a frame, as above. Returns the force's size.
uint32_t bt_lesson_factors(const int32_t force_100un[3], const bt_map_parts *parts,
                           int32_t factor[BT_LESSON_FACTORS]);

bt_lesson_verdict bt_lesson_judge(const bt_map *map, const int32_t force_100un[3], const bt_map_parts *parts);

// The largest shear of the lesson, and the counts of pressure in a newton of its normal; 0: unknown.
uint32_t bt_lesson_shear_max_mn(const bt_map *map);
uint32_t bt_lesson_counts_per_n(const bt_map *map);

// The map's margin, widened by the verdict.
void bt_lesson_margin(const bt_map *map, uint32_t apart, bt_margin *margin);

// The map's force, mixed with the population map's, scaled to fit this finger; and the guess for the mixture.
void bt_lesson_mix(const bt_map *map, uint32_t share, const int32_t otherwise_100un[3],
                   int32_t force_100un[3]);
uint32_t bt_lesson_guess_mn(const bt_map *map, uint32_t share, uint32_t guess_mn);

#endif
