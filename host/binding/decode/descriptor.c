#if !defined(_WIN32)
#define _DEFAULT_SOURCE
#endif
#include "decode/descriptor.h"

#if defined(_WIN32)

int64_t bt_descriptor_read(int fd, double timeout_s, uint8_t *into, size_t room, int64_t *arrived_ns)
{
    (void)fd, (void)timeout_s, (void)into, (void)room, (void)arrived_ns;
    return BT_DESCRIPTOR_ABSENT;
}

#else

#include <errno.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

#define TTY_BYTES 4000 // nearly what one tty read gives at most
#define MOST_MS   3600000

// Rounded up, and never below zero: poll() would wait for ever.
static int whole_ms(double timeout_s)
{
    double ms = timeout_s * 1e3;
    return ms > 0 ? (ms < MOST_MS ? (int)ms + 1 : MOST_MS) : 0;
}

static int64_t failure(void)
{
    return errno == EINTR || errno == EAGAIN || errno == EWOULDBLOCK ? BT_DESCRIPTOR_AGAIN : -errno;
}

static int64_t monotonic_ns(void)
{
#if defined(__APPLE__)
    return (int64_t)clock_gettime_nsec_np(CLOCK_UPTIME_RAW); // mach_absolute_time(), as Python has it
#else
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
#endif
}

int64_t bt_descriptor_read(int fd, double timeout_s, uint8_t *into, size_t room, int64_t *arrived_ns)
{
    struct pollfd watched = {.fd = fd, .events = POLLIN};
    int ready = poll(&watched, 1, whole_ms(timeout_s));
    if (ready <= 0) {
        return ready == 0 ? BT_DESCRIPTOR_NOTHING : failure();
    }
    // One tty read gives 4 KiB at most: a reader with one read per wake-up loses data at high rates.
    size_t filled = 0;
    ssize_t got;
    do {
        got = read(fd, into + filled, room - filled);
        filled += got > 0 ? (size_t)got : 0;
    } while (got >= TTY_BYTES && room - filled >= TTY_BYTES);
    // Bytes from before the port went are not lost; the next call will see that it went.
    if (filled == 0) {
        return got == 0 ? BT_DESCRIPTOR_HUNG_UP : failure();
    }
    *arrived_ns = monotonic_ns();
    return (int64_t)filled;
}

#endif
