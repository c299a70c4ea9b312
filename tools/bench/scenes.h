// Whole frames: what a board does per sensor and round besides the kernel.
#ifndef BIOTAC_BENCH_SCENES_H
#define BIOTAC_BENCH_SCENES_H

#include "solve/solve.h"

typedef struct {
    const char *kernel;
    const char *name;
    void (*run)(const bt_solve_settings *settings);
} bench_scene;

#define BENCH_SCENES 28
extern const bench_scene bench_scenes[BENCH_SCENES];

// Bring the scenes' fingers to where they are measured.
void bench_scenes_init(void);

#endif
