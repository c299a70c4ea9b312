#define _DEFAULT_SOURCE
#include "control.h"

#include "feed.h"
#include "pty.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

enum { PROGRAM, LISTENING };
static int fd[2] = {-1, -1};

// A program that does not read its answers loses them, as on every link.
static void send_frame(const uint8_t *frame, size_t bytes)
{
    (void)send(fd[PROGRAM], frame, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);
}

static void fill(bt_msg_emu_status *status)
{
    status->link_bytes = pty_written();
}

static bt_emu_feed feed = {.hello = &bt_emu_hello, .send = send_frame, .fill = fill};

unsigned control_open(bt_emu_stream *stream)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t bytes = sizeof at;
    feed.stream = stream;
    fd[LISTENING] = socket(AF_INET, SOCK_STREAM, 0);
    if (fd[LISTENING] < 0 || bind(fd[LISTENING], (struct sockaddr *)&at, sizeof at) != 0
        || listen(fd[LISTENING], 1) != 0 || getsockname(fd[LISTENING], (struct sockaddr *)&at, &bytes) != 0) {
        return 0;
    }
    return ntohs(at.sin_port);
}

void control_resume(bt_emu_stream *stream, const int fds[2])
{
    feed.stream = stream;
    fd[PROGRAM] = fds[PROGRAM];
    fd[LISTENING] = fds[LISTENING];
    bt_emu_feed_begin(&feed);
}

const int *control_fds(void)
{
    return fd;
}

static void accept_program(void)
{
    int no_delay = 1;
    fd[PROGRAM] = accept(fd[LISTENING], NULL, NULL);
    if (fd[PROGRAM] >= 0) {
        (void)setsockopt(fd[PROGRAM], IPPROTO_TCP, TCP_NODELAY, &no_delay, sizeof no_delay);
        (void)fcntl(fd[PROGRAM], F_SETFL, O_NONBLOCK);
        bt_emu_feed_begin(&feed);
    }
}

void control_poll(void)
{
    uint8_t bytes[1024];
    if (fd[PROGRAM] < 0) {
        accept_program();
        return;
    }
    const ssize_t n = recv(fd[PROGRAM], bytes, sizeof bytes, 0);
    if (n > 0) {
        bt_emu_feed_receive(&feed, bytes, (size_t)n);
    } else if (n == 0 || (errno != EAGAIN && errno != EINTR)) {
        (void)close(fd[PROGRAM]);
        fd[PROGRAM] = -1;
    }
}

void control_report(void)
{
    if (fd[PROGRAM] >= 0) {
        bt_emu_feed_report(&feed);
    }
}
