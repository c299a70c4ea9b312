#include "byte_queue.h"

#include <string.h>

size_t bt_bytes_put(bt_byte_queue *to, const uint8_t *data, size_t bytes)
{
    const size_t n = bytes < to->size - to->filled ? bytes : to->size - to->filled;
    const size_t end = (to->start + to->filled) % to->size, run = n < to->size - end ? n : to->size - end;
    memcpy(to->bytes + end, data, run);
    memcpy(to->bytes, data + run, n - run);
    to->filled += n;
    return n;
}

size_t bt_bytes_get(bt_byte_queue *from, uint8_t *data, size_t bytes)
{
    const size_t n = bytes < from->filled ? bytes : from->filled;
    const size_t run = n < from->size - from->start ? n : from->size - from->start;
    memcpy(data, from->bytes + from->start, run);
    memcpy(data + run, from->bytes, n - run);
    from->start = (from->start + n) % from->size;
    from->filled -= n;
    return n;
}
