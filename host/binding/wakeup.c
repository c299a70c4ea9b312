#define _POSIX_C_SOURCE 200809L
#define _DARWIN_C_SOURCE
#include "wakeup.h"

#include <time.h>

#ifdef _WIN32

void bt_wait_init(bt_wait *wait)
{
    InitializeSRWLock(&wait->lock);
    InitializeConditionVariable(&wait->news);
}

void bt_wait_free(bt_wait *wait)
{
    (void)wait;
}

void bt_wait_lock(bt_wait *wait)
{
    AcquireSRWLockExclusive(&wait->lock);
}

void bt_wait_unlock(bt_wait *wait)
{
    ReleaseSRWLockExclusive(&wait->lock);
}

void bt_wait_notify(bt_wait *wait)
{
    WakeAllConditionVariable(&wait->news);
}

void bt_wait_for(bt_wait *wait, uint64_t ns)
{
    (void)SleepConditionVariableSRW(&wait->news, &wait->lock, (DWORD)((ns + 999999) / 1000000), 0);
}

uint64_t bt_wall_ns(void)
{
    LARGE_INTEGER hz, now;
    QueryPerformanceFrequency(&hz);
    QueryPerformanceCounter(&now);
    const uint64_t per_s = (uint64_t)hz.QuadPart, ticks = (uint64_t)now.QuadPart;
    return ticks / per_s * 1000000000u + ticks % per_s * 1000000000u / per_s;
}

#else

void bt_wait_init(bt_wait *wait)
{
    pthread_condattr_t monotonic;
    (void)pthread_mutex_init(&wait->lock, NULL);
    (void)pthread_condattr_init(&monotonic);
#ifndef __APPLE__ // its waits are relative
    (void)pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
#endif
    (void)pthread_cond_init(&wait->news, &monotonic);
    (void)pthread_condattr_destroy(&monotonic);
}

void bt_wait_free(bt_wait *wait)
{
    (void)pthread_cond_destroy(&wait->news);
    (void)pthread_mutex_destroy(&wait->lock);
}

void bt_wait_lock(bt_wait *wait)
{
    (void)pthread_mutex_lock(&wait->lock);
}

void bt_wait_unlock(bt_wait *wait)
{
    (void)pthread_mutex_unlock(&wait->lock);
}

void bt_wait_notify(bt_wait *wait)
{
    (void)pthread_cond_broadcast(&wait->news);
}

void bt_wait_for(bt_wait *wait, uint64_t ns)
{
#ifdef __APPLE__
    const struct timespec t = {(time_t)(ns / 1000000000u), (long)(ns % 1000000000u)};
    (void)pthread_cond_timedwait_relative_np(&wait->news, &wait->lock, &t);
#else
    const uint64_t until_ns = bt_wall_ns() + ns;
    const struct timespec t = {(time_t)(until_ns / 1000000000u), (long)(until_ns % 1000000000u)};
    (void)pthread_cond_timedwait(&wait->news, &wait->lock, &t);
#endif
}

uint64_t bt_wall_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

#endif
