// Prints finger, us, x, y, z in 0.1 mN, flags, trust: ./example /dev/ttyACM0 500. README.md has the build
#define _DEFAULT_SOURCE // cfmakeraw
#include "biotac_client.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

static int fd;

static void command(uint8_t id, const void *msg)
{
    uint8_t out[BT_ENCODED_MAX_BYTES];
    if (write(fd, out, bt_client_write(id, msg, out)) <= 0) {
        exit(2);
    }
}

int main(int argc, char **argv)
{
    fd = argc == 3 ? open(argv[1], O_RDWR | O_NOCTTY) : -1;
    struct termios raw;
    if (fd < 0 || tcgetattr(fd, &raw) != 0) {
        fprintf(stderr, "usage: example PORT FRAMES; PORT must be a board's port that can be opened\n");
        return 2;
    }
    cfmakeraw(&raw);
    tcsetattr(fd, TCSANOW, &raw);

    static bt_client board;
    command(BT_HELLO_REQUEST_ID, &(bt_msg_hello_request){.req_id = 1, .nonce = 7});
    int left = atoi(argv[2]);
    for (uint8_t byte; left > 0 && read(fd, &byte, 1) == 1;) {
        int id = bt_client_push(&board, byte);
        bt_msg_hello hello;
        bt_msg_frame frame;
        if (id == BT_HELLO_ID && bt_client_read(&board, BT_HELLO_ID, &hello) && hello.nonce == 7) {
            if (hello.wire_major != BT_WIRE_MAJOR) {
                fprintf(stderr, "the board uses wire version %u, this program %u; build it for the board's\n",
                        hello.wire_major, (unsigned)BT_WIRE_MAJOR);
                return 2;
            }
            board.accept_longer = hello.wire_minor > BT_WIRE_MINOR;
            bt_msg_start start = {2, BT_STREAM_FLAG_FRAMES, .fingers = 0x1F, .keepalive_ms = 500};
            command(BT_START_ID, &start); // the stream ends when this program is gone for the keep-alive
        } else if (id == BT_FRAME_ID && bt_client_read(&board, BT_FRAME_ID, &frame)) {
            const int32_t *force = frame.force_100un; // BT_INVALID_I32 where there is none
            printf("%u %u %ld %ld %ld %lx %u\n", frame.finger, (unsigned)frame.t_us, (long)force[0],
                   (long)force[1], (long)force[2], (unsigned long)frame.flags, frame.trust);
            left--;
        }
        if (id == BT_IDLE_ID || (id == BT_FRAME_ID && left % 16 == 0)) {
            command(BT_PING_ID, &(bt_msg_ping){.req_id = 4}); // more than three in each keep-alive
        }
    }
    command(BT_STOP_ID, &(bt_msg_stop){.req_id = 3});
    return left > 0;
}
