#define _DEFAULT_SOURCE
#include "door.h"

#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <winsock2.h>
#include <ws2tcpip.h>

#include <windows.h>
#define IS_LATER              (WSAGetLastError() == WSAEWOULDBLOCK)
#define read(s, data, bytes)  recv((SOCKET)(s), (char *)(data), (int)(bytes), 0)
#define write(s, data, bytes) send((SOCKET)(s), (const char *)(data), (int)(bytes), 0)
#else
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>
#define IS_LATER    (errno == EAGAIN || errno == EINTR)
#define closesocket close
#define SOCKET      int
#endif

static void set_option(int s, int level, int option, int value)
{
    (void)setsockopt((SOCKET)s, level, option, (const char *)&value, sizeof value);
}

// No call waits for it, and a process in place of this one inherits it.
static void prepare(int s)
{
#ifdef _WIN32
    u_long yes = 1;
    (void)ioctlsocket((SOCKET)s, (long)FIONBIO, &yes);
    (void)SetHandleInformation((HANDLE)(SOCKET)s, HANDLE_FLAG_INHERIT, HANDLE_FLAG_INHERIT);
#else
    (void)fcntl(s, F_SETFL, O_NONBLOCK);
#endif
}

static void hang_up(int *s)
{
    (void)closesocket((SOCKET)*s);
    *s = -1;
}

unsigned door_open(door *d, int send_bytes)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t bytes = sizeof at;
    d->listening = (int)socket(AF_INET, SOCK_STREAM, 0);
    if (d->listening < 0) {
        return 0;
    }
#ifdef _WIN32 // elsewhere nobody else can bind a port that is listened on
    set_option(d->listening, SOL_SOCKET, SO_EXCLUSIVEADDRUSE, 1);
#endif
    if (send_bytes > 0) {
        set_option(d->listening, SOL_SOCKET, SO_SNDBUF, send_bytes); // its programs' sockets inherit that
    }
    prepare(d->listening);
    const SOCKET s = (SOCKET)d->listening;
    if (bind(s, (struct sockaddr *)&at, sizeof at) != 0 || listen(s, 8) != 0
        || getsockname(s, (struct sockaddr *)&at, &bytes) != 0) {
        return 0;
    }
    return ntohs(at.sin_port);
}

void door_resume(door *d, const int fds[2])
{
    char next;
    d->program = fds[0];
    d->listening = fds[1];
    for (int k = 0; k < 2; k++) {
        if (fds[k] >= 0) {
            prepare(fds[k]);
            // With this, resets under Wine succeed more often; why some still fail nobody knows.
            (void)recv((SOCKET)fds[k], &next, 1, MSG_PEEK);
        }
    }
}

bool door_admit(door *d)
{
    const char *token = getenv("BIOTAC_SIM_TOKEN");
    const size_t expected = token != NULL ? strlen(token) : 0;
    const int incoming = (int)accept((SOCKET)d->listening, NULL, NULL);
    if (incoming >= 0) {
        if (d->pending >= 0) {
            hang_up(&d->pending);
        }
        d->pending = incoming;
        d->token_bytes = d->wrong = 0;
        prepare(incoming);
        set_option(incoming, IPPROTO_TCP, TCP_NODELAY, 1);
    }
    while (d->pending >= 0 && d->token_bytes < expected) {
        char byte;
        const long n = (long)read(d->pending, &byte, 1);
        if (n < 0 && IS_LATER) {
            return false;
        }
        // All of it is compared, whatever was wrong: the time says nothing about the token.
        d->wrong |= (uint8_t)(n == 1 ? byte ^ token[d->token_bytes] : 1);
        d->token_bytes++;
        if (n != 1 || (d->token_bytes == expected && d->wrong != 0)) {
            hang_up(&d->pending);
        }
    }
    d->program = d->pending;
    d->pending = -1;
    return d->program >= 0;
}

static size_t passed(door *d, long n)
{
    if (d->listening >= 0 && d->program >= 0 && (n == 0 || (n < 0 && !IS_LATER))) {
        hang_up(&d->program);
    }
    return n > 0 ? (size_t)n : 0;
}

size_t door_send(door *d, const uint8_t *data, size_t bytes)
{
    return passed(d, (long)write(d->program, data, bytes));
}

size_t door_receive(door *d, uint8_t *data, size_t bytes)
{
    return passed(d, (long)read(d->program, data, bytes));
}
