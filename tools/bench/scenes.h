// Whole frames: a board's work per sensor and round besides the kernel.
#ifndef BIOTAC_BENCH_SCENES_H
#define BIOTAC_BENCH_SCENES_H

#include "solve/solve.h"

typedef struct {
    const char *kernel;
    const char *name;
    void (*run)(const bt_solve_settings *settings);
} bench_scene;

extern const bench_scene bench_scenes[]; // the last has no kernel

// Bring the scenes' fingers to where they are measured.
void bench_scenes_init(void);

#endif
