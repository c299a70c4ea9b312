// What differs between operating systems, for the simulated board: os_posix.c and os_windows.c.
#ifndef BIOTAC_POSIX_OS_H
#define BIOTAC_POSIX_OS_H

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifndef O_BINARY // only Windows has files of text
#define O_BINARY 0
#endif

// First of all: make stdin one that is not waited for. A program's board ends with that pipe: a signal to all
// processes of a terminal or a service is then ignored.
void os_begin(void);

// How many bytes came on stdin, 0: none yet, -1: it has ended.
int os_read_stdin(char *text, size_t bytes);

// Wait until the host has what is waited for, the control socket can be read (-1: neither), or us have
// passed; -1: as long as nothing comes on stdin.
enum { OS_BYTES = 1, OS_ROOM = 2 };
void os_wait(int host, int wanted, int control, int64_t us);

// The number of an open file that os_restart's process opens by os_inherited.
int os_inherit(int file);
int os_inherited(int number);

// Run this program anew, with the same arguments, this environment variable and what it has open. Returns
// only if it can't, with errno set.
void os_restart(const char *name, const char *value, char **arguments);

// A pseudo-terminal, raw: returns its master and sets the path of the side that the host opens; -1 with errno
// set.
#ifdef _WIN32
#define pty_open(path)       ((void)(path), errno = ENOSYS, -1)
#define pty_has_host(master) false
#else
int pty_open(const char **path);
bool pty_has_host(int master); // whether somebody has the other side open
#endif

#endif
