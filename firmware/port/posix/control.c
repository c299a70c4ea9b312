#define _DEFAULT_SOURCE
#include "control.h"

#include "feed.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

static bt_emu_stream *stream;
static bt_emu_feed feed;
static int listening = -1;
static int program = -1;

void control_init(bt_emu_stream *fed)
{
    stream = fed;
}

int control_listening_fd(void)
{
    return listening;
}

int control_program_fd(void)
{
    return program;
}

unsigned control_open(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t bytes = sizeof at;
    listening = socket(AF_INET, SOCK_STREAM, 0);
    if (listening < 0 || bind(listening, (struct sockaddr *)&at, sizeof at) != 0 || listen(listening, 1) != 0
        || getsockname(listening, (struct sockaddr *)&at, &bytes) != 0) {
        return 0;
    }
    return ntohs(at.sin_port);
}

int control_fd(void)
{
    return program >= 0 ? program : listening;
}

// A program that does not read its answers loses them, as on every link.
static void send_frame(const uint8_t *frame, size_t bytes)
{
    (void)send(program, frame, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);
}

void control_resume(int listening_fd, int program_fd)
{
    listening = listening_fd;
    program = program_fd;
    bt_emu_feed_begin(&feed, stream, send_frame);
}

static void accept_program(void)
{
    int no_delay = 1;
    program = accept(listening, NULL, NULL);
    if (program >= 0) {
        (void)setsockopt(program, IPPROTO_TCP, TCP_NODELAY, &no_delay, sizeof no_delay);
        (void)fcntl(program, F_SETFL, O_NONBLOCK);
        bt_emu_feed_begin(&feed, stream, send_frame);
    }
}

void control_poll(uint32_t link_bytes)
{
    uint8_t bytes[1024];
    if (program < 0) {
        accept_program();
        return;
    }
    ssize_t n = recv(program, bytes, sizeof bytes, 0);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) {
        (void)close(program);
        program = -1;
    }
    feed.link_bytes = link_bytes;
    bt_emu_feed_receive(&feed, bytes, n > 0 ? (size_t)n : 0);
}

void control_report_stillness(uint32_t link_bytes)
{
    if (program >= 0) {
        feed.link_bytes = link_bytes;
        bt_emu_feed_report(&feed);
    }
}
