// How a program feeds the simulated board's sensors while it runs: a TCP socket on the loopback interface
// with what emu/feed.h says, for one program at a time.
#ifndef BIOTAC_POSIX_CONTROL_H
#define BIOTAC_POSIX_CONTROL_H

#include "stream.h"

// Listen, or go on with the descriptors of a process before. Returns the TCP port, or 0 with errno set.
unsigned control_open(bt_emu_stream *stream);
void control_resume(bt_emu_stream *stream, const int fds[2]);
void control_fds(int fds[2]); // of the program, -1: none; and where the next one comes, -1: nobody

// Let a program in, or carry out what it sent; without a door, nothing.
void control_poll(void);

// Report to it that time stands still, once for each length of the tape.
void control_report(void);

#endif
