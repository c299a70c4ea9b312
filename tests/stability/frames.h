// Frames of signals to try kernels on: every extreme that can be listed, six random classes, and
// changes for hill climbing. Deterministic: the same seed gives the same frames on every machine.
#ifndef BIOTAC_STRESS_FRAMES_H
#define BIOTAC_STRESS_FRAMES_H

#include "kernels.h"

#define DEFAULT_SEED 20131u

uint64_t draw(uint64_t *state);                                 // xorshift64*; state must not be 0
int64_t draw_range(uint64_t *state, int64_t low, int64_t high); // both included
double draw_unit(uint64_t *state);                              // 0 <= value < 1

// Frame k of a list; false when the list is over. What the random numbers in it are depends on k alone.
typedef bool listed(int64_t k, int32_t e_q4[BT_ELECTRODES]);

typedef struct {
    const char *name;
    listed *frame;
} frame_list;

#define LISTS 7
extern const frame_list lists[LISTS];

typedef struct {
    const char *name;
    void (*fill)(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES]);
} frame_class;

#define CLASSES 6
extern const frame_class classes[CLASSES];

// Where the weighted x of the electrodes is, in um; W must not be 0.
double centre_x_um(const int32_t e_q4[BT_ELECTRODES], int weights);

// A small change, for hill climbing.
void change_frame(uint64_t *state, int32_t e_q4[BT_ELECTRODES]);

// Compression in counts under a round tip: the largest, its half width, and where it is.
void press(const double at_mm[3], double width_mm, double top_count, double e[BT_ELECTRODES]);

// On the core's surface: x, and the angle from the ventral line about the axis.
void on_core(double x_mm, double angle, double at_mm[3]);

#endif
