// The simulated board's USB-serial port, with a transmit ring: a pseudo-terminal, or a loopback socket
// (door.h).
#ifndef BIOTAC_POSIX_LINK_H
#define BIOTAC_POSIX_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Open it and print where the host finds it. Returns false with errno set.
// lossless: a full ring waits for the host instead of refusing; device time stands still meanwhile.
bool link_open(bool by_socket, bool lossless);

// Go on with the descriptors of a process before.
void link_resume(const int fds[2], bool lossless);
void link_fds(int fds[2]); // of the host, and where the next one comes, which a pty has not: -1

bool link_up(void);    // a host has it open
void link_admit(void); // let the next host in; link_up has said that there is none
bool link_write(const uint8_t *data, size_t bytes);
size_t link_read(uint8_t *data, size_t bytes);

// Hand the ring to the system as far as it takes it.
void link_flush(void);
void link_drain(void); // all of it, if it waits for the host

// Bytes that link_write has accepted since the start; wraps.
uint32_t link_written(void);

// Wait until the host sent something, `control` (-1: none) becomes readable or us have passed; -1: as long as
// nothing comes on stdin either.
void link_wait(int control, int64_t us);

#endif
