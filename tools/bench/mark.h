// An image's reports to the emulator of the code that it runs. Two for each board: the Cortex-M0+ in
// rp2040js (m0plus.c), the Cortex-M4F in QEMU (m4f.c).
#ifndef BIOTAC_BENCH_MARK_H
#define BIOTAC_BENCH_MARK_H

#include <stdint.h>

// Before a run and after it. The emulator knows this function by address.
void bench_mark(void);

// Names the next run, before the first mark.
void bench_name(const char *kernel, const char *scene);

// A hash that this image computed, and that it has nothing more to say.
void bench_result(uint32_t value);
void bench_end(void);

#endif
