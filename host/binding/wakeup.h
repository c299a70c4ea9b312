// A lock with a condition, and the clock of waiting threads: of POSIX and of Windows.
#ifndef BIOTAC_WAKEUP_H
#define BIOTAC_WAKEUP_H

#include <stdint.h>

#ifdef _WIN32
#include <windows.h>
typedef struct {
    SRWLOCK lock;
    CONDITION_VARIABLE news;
} bt_wait;
#else
#include <pthread.h>
typedef struct {
    pthread_mutex_t lock;
    pthread_cond_t news;
} bt_wait;
#endif

void bt_wait_init(bt_wait *wait);
void bt_wait_free(bt_wait *wait);
void bt_wait_lock(bt_wait *wait);
void bt_wait_unlock(bt_wait *wait);

// With the lock held. Waiting gives it up, and may end early.
void bt_wait_notify(bt_wait *wait);
void bt_wait_for(bt_wait *wait, uint64_t ns);

// Since some moment; monotonic.
uint64_t bt_wall_ns(void);

#endif
