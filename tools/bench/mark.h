// How an image tells the emulator that watches it what it runs. Two for each board: the Cortex-M0+ in
// rp2040js (m0plus.c), the Cortex-M4F in QEMU (m4f.c).
#ifndef BIOTAC_BENCH_MARK_H
#define BIOTAC_BENCH_MARK_H

#include <stdint.h>

// Before a run and after it. The watcher knows this function by its address.
void bench_mark(void);

// What the next run is, before its first mark.
void bench_name(const char *kernel, const char *scene);

// A hash that this image computed, and that it has nothing more to say.
void bench_result(uint32_t value);
void bench_end(void);

#endif
