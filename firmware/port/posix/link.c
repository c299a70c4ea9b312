#include "link.h"

#include "door.h"
#include "os.h"

#include <stdio.h>
#include <string.h>

#define RING_BYTES 16384
// Of what the system keeps, as a pty does: or a board that waits for its host would be far ahead.
#define SEND_BYTES 4096

static door host = DOOR_CLOSED; // a pty is one without a socket to listen on
static bool wait_for_host;
static uint8_t ring[RING_BYTES];
static size_t ring_start;
static size_t ring_filled;
static uint32_t written;

bool link_open(bool by_socket, bool lossless)
{
    const char *path = NULL;
    wait_for_host = lossless;
    if (by_socket) {
        const unsigned port = door_open(&host, SEND_BYTES);
        printf("socket %u\n", port);
        return port != 0;
    }
    host.program = pty_open(&path);
    printf("pty %s\n", path != NULL ? path : "");
    return host.program >= 0;
}

void link_resume(const int fds[2], bool lossless)
{
    wait_for_host = lossless;
    door_resume(&host, fds);
}

void link_fds(int fds[2])
{
    fds[0] = host.program;
    fds[1] = host.listening;
}

bool link_up(void)
{
    bool up = host.program >= 0 && (host.listening >= 0 || pty_has_host(host.program));
    if (!up) {
        ring_filled = 0; // a new host must not get the old one's tail
    }
    return up;
}

void link_admit(void)
{
    if (host.listening >= 0) {
        (void)door_admit(&host);
    }
}

void link_flush(void)
{
    while (ring_filled > 0) {
        size_t run = RING_BYTES - ring_start;
        const size_t n = door_send(&host, ring + ring_start, run < ring_filled ? run : ring_filled);
        if (n == 0) {
            return; // full, or nobody there; link_up finds out which
        }
        ring_start = (ring_start + n) % RING_BYTES;
        ring_filled -= n;
    }
}

static void put(const uint8_t *data, size_t bytes)
{
    size_t end = (ring_start + ring_filled) % RING_BYTES;
    size_t run = RING_BYTES - end;
    run = run < bytes ? run : bytes;
    memcpy(ring + end, data, run);
    memcpy(ring, data + run, bytes - run);
    ring_filled += bytes;
}

static bool make_room(size_t bytes)
{
    while (RING_BYTES - ring_filled < bytes) {
        link_flush();
        if (RING_BYTES - ring_filled >= bytes) {
            break;
        }
        if (!wait_for_host || !link_up()) {
            return false;
        }
        os_wait(host.program, OS_ROOM, -1, 100000);
    }
    return true;
}

void link_drain(void)
{
    (void)make_room(RING_BYTES);
}

bool link_write(const uint8_t *data, size_t bytes)
{
    if (!make_room(bytes)) {
        return false;
    }
    put(data, bytes);
    written += (uint32_t)bytes;
    return true;
}

uint32_t link_written(void)
{
    return written;
}

size_t link_read(uint8_t *data, size_t bytes)
{
    return door_receive(&host, data, bytes);
}

void link_wait(int control, int64_t us)
{
    // While nobody has the port open, POLLHUP is always set and poll() would not wait on it.
    bool up = link_up();
    int64_t longest_us = up ? us : us < 0 || us > 2000 ? 2000 : us; // look for a new host every 2 ms
    os_wait(up ? host.program : -1, OS_BYTES | (ring_filled > 0 ? OS_ROOM : 0), control, longest_us);
}
