#define _POSIX_C_SOURCE 200809L
#include "clock.h"

#include <time.h>

static uint64_t now_ns;
static double pace;
static uint64_t base_device_ns;
static uint64_t base_wall_ns;

static uint64_t wall_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

void clock_init(double device_seconds_per_second)
{
    now_ns = 0;
    pace = device_seconds_per_second;
    clock_rebase();
}

uint64_t clock_now_ns(void)
{
    return now_ns;
}

void clock_advance_ns(uint64_t ns)
{
    now_ns += ns;
}

void clock_rebase(void)
{
    base_device_ns = now_ns;
    base_wall_ns = wall_ns();
}

void clock_catch_up(void)
{
    int64_t us;
    while ((us = clock_wait_us(now_ns)) > 0) {
        struct timespec t = {(time_t)(us / 1000000), (long)(us % 1000000 * 1000)}; // both of 32 bits on some
        (void)nanosleep(&t, NULL);
    }
}

void clock_follow(uint64_t until_ns)
{
    if (pace <= 0) {
        return;
    }
    uint64_t due_ns = base_device_ns + (uint64_t)((double)(wall_ns() - base_wall_ns) * pace) + 1;
    uint64_t to_ns = due_ns < until_ns ? due_ns : until_ns;
    now_ns = to_ns > now_ns ? to_ns : now_ns;
}

int64_t clock_wait_us(uint64_t t_ns)
{
    if (pace <= 0) {
        return 0;
    }
    uint64_t due_ns = base_wall_ns + (uint64_t)((double)(t_ns - base_device_ns) / pace);
    uint64_t wall = wall_ns();
    return due_ns > wall ? (int64_t)((due_ns - wall) / 1000) : 0;
}
