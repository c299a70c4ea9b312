// A TCP port on the loopback interface, for one program at a time that says the token first: the environment
// variable BIOTAC_SIM_TOKEN, which whoever started this process has chosen. Without one any program is let
// in.
#ifndef BIOTAC_POSIX_DOOR_H
#define BIOTAC_POSIX_DOOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    int program;   // who was let in; this and the next two are sockets, -1: none
    int listening; // where the next one comes
    int pending;   // who has not said the whole token yet; the next one to come takes its place
    size_t token_bytes;
    uint8_t wrong; // bits by which what was said differs
} door;

#define DOOR_CLOSED {.program = -1, .listening = -1, .pending = -1}

// Returns the TCP port, or 0 with errno set. send_bytes: the most that
// waits in the system for the program, 0: as much as that likes.
unsigned door_open(door *d, int send_bytes);

// Go on with the program and the listening socket of a process before.
void door_resume(door *d, const int fds[2]);

// Look whether somebody came, or said the token; only while there is no program. Returns true once one is let
// in.
bool door_admit(door *d);

// Bytes taken or come, 0 if none at once. A program that has gone is let go.
size_t door_send(door *d, const uint8_t *data, size_t bytes);
size_t door_receive(door *d, uint8_t *data, size_t bytes);

#endif
