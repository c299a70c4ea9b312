// Bytes on their way between an interrupt and the main loop: one writer, one reader. Plain loads and stores,
// as a Cortex-M0+ has no atomic read-modify-write, and one writer needs none.
#ifndef BIOTAC_RING_H
#define BIOTAC_RING_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t *bytes;
    uint32_t size;         // a power of two
    _Atomic uint32_t head; // bytes ever put in, modulo 2^32; the writer's
    _Atomic uint32_t tail; // and taken out; the reader's
} ring;

#define RING(name, size_)                                                                                    \
    _Static_assert(((size_) & ((size_) - 1)) == 0, "indices wrap");                                          \
    static uint8_t name##_bytes[size_];                                                                      \
    static ring name = {.bytes = name##_bytes, .size = (size_)}

static inline uint32_t ring_get(_Atomic uint32_t *index)
{
    return atomic_load_explicit(index, memory_order_acquire);
}

static inline void ring_set(_Atomic uint32_t *index, uint32_t value)
{
    atomic_store_explicit(index, value, memory_order_release);
}

static inline uint32_t ring_filled(ring *r)
{
    return ring_get(&r->head) - ring_get(&r->tail);
}

static inline uint32_t ring_room(ring *r)
{
    return r->size - ring_filled(r);
}

static inline uint8_t *ring_at(ring *r, uint32_t index)
{
    return r->bytes + (index & (r->size - 1));
}

// Number of bytes, of so many from index on, that lie in one piece; the others lie at the ring's start.
static inline uint32_t ring_run(const ring *r, uint32_t index, uint32_t bytes)
{
    const uint32_t to_end = r->size - (index & (r->size - 1));
    return bytes < to_end ? bytes : to_end;
}

// A library's memcpy copies bytes too and needs twice as long for one; and a device's memory is volatile.
static inline void copy_bytes(volatile uint8_t *to, const uint8_t *from, uint32_t bytes)
{
#pragma GCC unroll 4
    for (uint32_t k = 0; k < bytes; k++) {
        to[k] = from[k];
    }
}

// The writer's. Accepts all bytes or none.
static inline bool ring_put(ring *r, const uint8_t *data, size_t bytes)
{
    const uint32_t head = ring_get(&r->head);
    if (bytes > ring_room(r)) {
        return false;
    }
    const uint32_t first = ring_run(r, head, (uint32_t)bytes);
    copy_bytes(ring_at(r, head), data, first);
    copy_bytes(r->bytes, data + first, (uint32_t)bytes - first);
    ring_set(&r->head, head + (uint32_t)bytes);
    return true;
}

// The reader's. Returns the number of bytes.
static inline size_t ring_pop(ring *r, uint8_t *data, size_t bytes)
{
    uint32_t tail = ring_get(&r->tail);
    const uint32_t filled = ring_get(&r->head) - tail;
    if (filled == 0) {
        return 0;
    }
    const size_t count = filled < bytes ? filled : bytes;
    for (size_t k = 0; k < count; k++) {
        data[k] = *ring_at(r, tail++);
    }
    ring_set(&r->tail, tail);
    return count;
}

// The reader's: drops all bytes.
static inline void ring_forget(ring *r)
{
    ring_set(&r->tail, ring_get(&r->head));
}

#endif
