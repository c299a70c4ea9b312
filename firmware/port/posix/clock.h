// Device time of the simulated board: it passes only when the firmware uses it up or sleeps, and is
// held against the wall clock, or not, by its pace. Same input, same bytes.
#ifndef BIOTAC_POSIX_CLOCK_H
#define BIOTAC_POSIX_CLOCK_H

#include <stdint.h>

// pace: device seconds per wall second; 0 is as fast as the host reads.
void clock_init(double pace);
uint64_t clock_now_ns(void);
void clock_advance_ns(uint64_t ns);

// Wall-clock us until device time t_ns is due at this pace; 0 when it is due, or nothing paces.
int64_t clock_wait_us(uint64_t t_ns);

// Sleep until device time is due.
void clock_catch_up(void);

// Move device time on to the wall clock's, at this pace, as far as until_ns.
void clock_follow(uint64_t until_ns);

// Start pacing from here, after device time stood still.
void clock_rebase(void);

#endif
