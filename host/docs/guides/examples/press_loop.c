// Closes a loop over a simulated finger: presses until it feels 2 N, and stays where it is while `trust` says
// not to act on the force. `biotac sim --live index` prints the arguments.
//   cc -I firmware/client -o loop press_loop.c firmware/client/biotac_client.c
//   ./loop /dev/pts/4 43817 TOKEN
#define _DEFAULT_SOURCE // cfmakeraw
#include "biotac_client.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#define ROUNDS   800
#define REST     350 // rounds in which the board tares ...
#define CONFIRM  400 // ... a press of 2 N until here; the release confirms that the tare was not a hold's
#define BEGIN    500
#define WANTED_N 2.0

static bt_client board;
static int port;

static void command(uint8_t id, const void *msg)
{
    uint8_t out[BT_ENCODED_MAX_BYTES];
    if (write(port, out, bt_client_write(id, msg, out)) <= 0) {
        exit(2);
    }
}

// The next message with this id.
static void receive(int id, void *msg)
{
    uint8_t byte;
    while (read(port, &byte, 1) == 1) {
        if (bt_client_push(&board, byte) == id && bt_client_read(&board, (uint8_t)id, msg)) {
            return;
        }
    }
    exit(3);
}

int main(int argc, char **argv)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    at.sin_port = htons((uint16_t)(argc == 4 ? atoi(argv[2]) : 0));
    const int loads = socket(AF_INET, SOCK_STREAM, 0);
    struct termios raw;
    port = argc == 4 ? open(argv[1], O_RDWR | O_NOCTTY) : -1;
    if (port < 0 || tcgetattr(port, &raw) != 0 || connect(loads, (struct sockaddr *)&at, sizeof at) != 0) {
        fprintf(stderr, "usage: loop PORT LOADS TOKEN; `biotac sim --live index` prints all three\n");
        return 2;
    }
    char token[80];
    const int said = snprintf(token, sizeof token, "%s\n", argv[3]);
    if (write(loads, token, (size_t)said) != said) {
        return 3;
    }
    cfmakeraw(&raw);
    tcsetattr(port, TCSANOW, &raw);
    command(BT_START_ID, &(bt_msg_start){.req_id = 1, .streams = BT_STREAM_FLAG_FRAMES, .fingers = 1});
    receive(BT_REPLY_ID, &(bt_msg_reply){0});

    double press_n = 0;
    for (int round = 0; round < ROUNDS; round++) {
        char line[80], answer[80];
        const int bytes = snprintf(line, sizeof line, "{\"index\": {\"normal_n\": %.4f}}\n", press_n);
        if (write(loads, line, (size_t)bytes) != bytes || read(loads, answer, sizeof answer) <= 0) {
            return 3;
        }
        bt_msg_frame frame;
        receive(BT_FRAME_ID, &frame); // of this round: the board's time stands still until the next line
        const double felt_n = bt_valid_i32(frame.force_100un[2]) ? frame.force_100un[2] * 1e-4 : 0;
        if (round < BEGIN) {
            press_n = round < REST || round >= CONFIRM ? 0 : WANTED_N;
        } else if (frame.trust >= BT_TRUST_INTERVAL) {
            press_n += 0.05 * (WANTED_N - felt_n);
        }
        printf("%u %.3f %.3f\n", frame.seq, press_n, felt_n);
    }
    return 0;
}
