// Bytes in the order in which they came, in memory of a fixed size.
#ifndef BIOTAC_BYTE_QUEUE_H
#define BIOTAC_BYTE_QUEUE_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t *bytes; // `size` of them, of the queue's owner
    size_t size, start, filled;
} bt_byte_queue;

// Both return how many bytes: those for which there is room, and those that are there.
size_t bt_bytes_put(bt_byte_queue *to, const uint8_t *data, size_t bytes);
size_t bt_bytes_get(bt_byte_queue *from, uint8_t *data, size_t bytes);

#endif
