#define _XOPEN_SOURCE 700
#define _DEFAULT_SOURCE
#define _DARWIN_C_SOURCE // cfmakeraw, which XOPEN hides there
#include "os.h"

#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

void os_begin(void)
{
    struct stat input;
    (void)signal(SIGPIPE, SIG_IGN); // of a socket whose program has gone
    (void)fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    if (fstat(STDIN_FILENO, &input) == 0 && S_ISFIFO(input.st_mode)) {
        (void)signal(SIGINT, SIG_IGN);
        (void)signal(SIGTERM, SIG_IGN);
        (void)signal(SIGHUP, SIG_IGN);
    }
}

int os_read_stdin(char *text, size_t bytes)
{
    ssize_t n = read(STDIN_FILENO, text, bytes);
    return n == 0 ? -1 : n > 0 ? (int)n : 0;
}

void os_wait(int host, int wanted, int control, int64_t us)
{
    struct pollfd p[3] = {
        {.fd = host, .events = (short)((wanted & OS_BYTES ? POLLIN : 0) | (wanted & OS_ROOM ? POLLOUT : 0))},
        {.fd = control, .events = POLLIN},
        {.fd = us < 0 ? STDIN_FILENO : -1, .events = POLLIN},
    };
    (void)poll(p, 3, us < 0 ? -1 : (int)((us + 999) / 1000));
}

int os_inherit(int file)
{
    return file;
}

int os_inherited(int number)
{
    return number;
}

void os_restart(const char *name, const char *value, char **arguments)
{
    (void)setenv(name, value, 1);
    (void)execv("/proc/self/exe", arguments);
    (void)execvp(arguments[0], arguments); // where there is no /proc
}

int pty_open(const char **path)
{
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) {
        return -1;
    }
    *path = ptsname(master);
    // Raw from the start: an echoing terminal would send our own frames back to us.
    int slave = *path != NULL ? open(*path, O_RDWR | O_NOCTTY) : -1;
    if (slave < 0) {
        return -1;
    }
    struct termios raw;
    if (tcgetattr(slave, &raw) == 0) {
        cfmakeraw(&raw);
        (void)tcsetattr(slave, TCSANOW, &raw);
    }
    (void)close(slave); // while nobody holds it, poll() on the master says POLLHUP: that is our DTR
    (void)fcntl(master, F_SETFL, O_NONBLOCK);
    return master;
}

bool pty_has_host(int master)
{
    struct pollfd p = {.fd = master, .events = 0};
    (void)poll(&p, 1, 0);
    return (p.revents & POLLHUP) == 0;
}
