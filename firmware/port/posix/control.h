// How a program feeds the simulated board's sensors while it runs: a TCP socket on the loopback interface that
// carries the commands of emu/feed.h, framed as on a gateway's link. One program at a time; the next one may
// connect when it has gone.
#ifndef BIOTAC_POSIX_CONTROL_H
#define BIOTAC_POSIX_CONTROL_H

#include "stream.h"

void control_init(bt_emu_stream *stream);

// Listen. Returns the TCP port, or 0 with errno set.
unsigned control_open(void);

// Go on with the descriptors of a process before; -1: no program.
void control_resume(int listening_fd, int program_fd);
int control_listening_fd(void);
int control_program_fd(void);

// The descriptor to wait for: the program's, or where the next one will come. -1: not open.
int control_fd(void);

// Accept a program, or carry out what it sent. link_bytes goes into the answers.
void control_poll(uint32_t link_bytes);

// Report that time stands still, once for each length of the tape.
void control_report_stillness(uint32_t link_bytes);

#endif
