#include "control.h"

#include "door.h"
#include "feed.h"
#include "link.h"

static door feeder = DOOR_CLOSED;

// A program that does not read its answers loses them, as on every link.
static void send_frame(const uint8_t *frame, size_t bytes)
{
    (void)door_send(&feeder, frame, bytes);
}

static void fill(bt_msg_emu_status *status)
{
    status->link_bytes = link_written();
}

static bt_emu_feed feed = {.hello = &bt_emu_hello, .send = send_frame, .fill = fill};

unsigned control_open(bt_emu_stream *stream)
{
    feed.stream = stream;
    return door_open(&feeder, 0);
}

void control_resume(bt_emu_stream *stream, const int fds[2])
{
    feed.stream = stream;
    door_resume(&feeder, fds);
    bt_emu_feed_begin(&feed);
}

void control_fds(int fds[2])
{
    fds[0] = feeder.program;
    fds[1] = feeder.listening;
}

void control_poll(void)
{
    uint8_t bytes[1024];
    if (feeder.program >= 0) {
        const size_t n = door_receive(&feeder, bytes, sizeof bytes);
        if (n > 0) {
            bt_emu_feed_receive(&feed, bytes, n);
        }
    } else if (feeder.listening >= 0 && door_admit(&feeder)) {
        bt_emu_feed_begin(&feed);
    }
}

void control_report(void)
{
    if (feeder.program >= 0) {
        bt_emu_feed_report(&feed);
    }
}
