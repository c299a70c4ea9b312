#define _XOPEN_SOURCE 700
#define _DEFAULT_SOURCE
#define _DARWIN_C_SOURCE // cfmakeraw, which XOPEN hides there
#include "pty.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define RING_BYTES 16384

static int master = -1;
static bool wait_for_host;
static uint8_t ring[RING_BYTES];
static size_t ring_start;
static size_t ring_filled;
static uint32_t written;

const char *pty_open(bool lossless)
{
    wait_for_host = lossless;
    master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) {
        return NULL;
    }
    const char *path = ptsname(master);
    if (path == NULL) {
        return NULL;
    }
    // Raw from the start: an echoing terminal would send our own frames back to us.
    int slave = open(path, O_RDWR | O_NOCTTY);
    if (slave < 0) {
        return NULL;
    }
    struct termios raw;
    if (tcgetattr(slave, &raw) == 0) {
        cfmakeraw(&raw);
        (void)tcsetattr(slave, TCSANOW, &raw);
    }
    (void)close(slave); // while nobody holds it, poll() on the master says POLLHUP: that is our DTR
    (void)fcntl(master, F_SETFL, O_NONBLOCK);
    return path;
}

void pty_resume(int fd, bool lossless)
{
    master = fd;
    wait_for_host = lossless;
}

int pty_fd(void)
{
    return master;
}

bool pty_up(void)
{
    struct pollfd p = {.fd = master, .events = 0};
    (void)poll(&p, 1, 0);
    bool up = (p.revents & POLLHUP) == 0;
    if (!up) {
        ring_filled = 0; // a new host must not get the old one's tail
    }
    return up;
}

void pty_flush(void)
{
    while (ring_filled > 0) {
        size_t run = RING_BYTES - ring_start;
        run = run < ring_filled ? run : ring_filled;
        ssize_t n = write(master, ring + ring_start, run);
        if (n <= 0) {
            return; // full, or nobody there; pty_up finds out which
        }
        ring_start = (ring_start + (size_t)n) % RING_BYTES;
        ring_filled -= (size_t)n;
    }
}

static void put(const uint8_t *data, size_t bytes)
{
    size_t at = (ring_start + ring_filled) % RING_BYTES;
    size_t run = RING_BYTES - at;
    run = run < bytes ? run : bytes;
    memcpy(ring + at, data, run);
    memcpy(ring, data + run, bytes - run);
    ring_filled += bytes;
}

bool pty_write(const uint8_t *data, size_t bytes)
{
    while (RING_BYTES - ring_filled < bytes) {
        pty_flush();
        if (RING_BYTES - ring_filled >= bytes) {
            break;
        }
        if (!wait_for_host || !pty_up()) {
            return false;
        }
        struct pollfd p = {.fd = master, .events = POLLOUT};
        (void)poll(&p, 1, 100);
    }
    put(data, bytes);
    written += (uint32_t)bytes;
    return true;
}

uint32_t pty_written(void)
{
    return written;
}

size_t pty_read(uint8_t *data, size_t bytes)
{
    ssize_t n = read(master, data, bytes);
    return n > 0 ? (size_t)n : 0;
}

enum pty_waited pty_wait(int other, int another, int64_t us)
{
    // While nobody has the port open, POLLHUP is always set and poll() would not wait on it.
    bool up = pty_up();
    struct pollfd p[3] = {
        {.fd = up ? master : -1, .events = (short)(POLLIN | (ring_filled > 0 ? POLLOUT : 0))},
        {.fd = other, .events = POLLIN},
        {.fd = another, .events = POLLIN},
    };
    int64_t longest_us = up ? us : us < 0 || us > 2000 ? 2000 : us; // look for a new host every 2 ms
    (void)poll(p, 3, longest_us < 0 ? -1 : (int)((longest_us + 999) / 1000));
    return p[1].revents ? PTY_WAITED_OTHER : p[2].revents ? PTY_WAITED_ANOTHER : PTY_WAITED;
}
