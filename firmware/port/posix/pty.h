// The simulated board's USB-serial port: a pseudo-terminal with a transmit ring.
#ifndef BIOTAC_POSIX_PTY_H
#define BIOTAC_POSIX_PTY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Opens a pty and returns the path of the side that the host opens, or NULL with errno set.
// lossless: a full ring waits for the host instead of refusing; device time stands still meanwhile.
const char *pty_open(bool lossless);

// Go on with the master side of a process before.
void pty_resume(int fd, bool lossless);
int pty_fd(void);

bool pty_up(void); // a host has it open
bool pty_write(const uint8_t *data, size_t bytes);
size_t pty_read(uint8_t *data, size_t bytes);

// Hand the ring to the kernel as far as it takes it.
void pty_flush(void);

// Bytes that pty_write has accepted since the start; wraps.
uint32_t pty_written(void);

// Wait until the host sent something, `other` or `another` becomes readable (-1: none) or us have passed (-1:
// forever). Says which of the two it was.
enum pty_waited { PTY_WAITED, PTY_WAITED_OTHER, PTY_WAITED_ANOTHER };
enum pty_waited pty_wait(int other, int another, int64_t us);

#endif
