// Reading a serial port by a file descriptor, where there are such: not on Windows.
#ifndef BIOTAC_DESCRIPTOR_H
#define BIOTAC_DESCRIPTOR_H

#include <stddef.h>
#include <stdint.h>

// The result of bt_descriptor_read() without bytes; else their number, or an errno below zero.
enum bt_descriptor_outcome {
    BT_DESCRIPTOR_NOTHING = 0,
    BT_DESCRIPTOR_HUNG_UP = -100001,
    // A signal came in between, or another program read the bytes: the time is not over.
    BT_DESCRIPTOR_AGAIN = -100002,
    BT_DESCRIPTOR_ABSENT = -100003 // this system has no such ports
};

// Waits up to timeout_s for bytes on ``fd``, which does not block, then reads all that are there, at most
// ``room``, and their time: arrived_ns is of time.monotonic()'s clock.
int64_t bt_descriptor_read(int fd, double timeout_s, uint8_t *into, size_t room, int64_t *arrived_ns);

#endif
