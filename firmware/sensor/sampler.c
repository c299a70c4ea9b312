#include "sampler.h"

#include <stddef.h>
#include <string.h>

// port_now_us() truncates, so a minimum time needs one us more.
#define SETTLE_TICKS_US (BT_SETTLE_US + 1)

_Static_assert((BT_SLOT_RING & (BT_SLOT_RING - 1)) == 0 && BT_SLOT_RING <= 128,
               "ring indices wrap in a byte");

void bt_sampler_start(bt_sampler *sampler, bt_port *port, uint8_t fingers, uint32_t start_us, bool by_core)
{
    memset(sampler, 0, offsetof(bt_sampler, query));
    sampler->port = port;
    sampler->fingers = fingers;
    sampler->slot_start_us = start_us;
    sampler->by_core = by_core;
}

// Only the interrupt writes it, so a plain load and store will do; ++ would need an atomic read-modify-write,
// which a Cortex-M0+ does not have.
static void count(_Atomic uint32_t *lost)
{
    atomic_store_explicit(lost, atomic_load_explicit(lost, memory_order_relaxed) + 1, memory_order_relaxed);
}

static void push(bt_sampler *sampler)
{
    uint8_t head = atomic_load_explicit(&sampler->head, memory_order_relaxed);
    uint8_t tail = atomic_load_explicit(&sampler->tail, memory_order_acquire);
    if ((uint8_t)(head - tail) == BT_SLOT_RING) {
        count(&sampler->late);
        return;
    }
    sampler->ring[head % BT_SLOT_RING] = sampler->current;
    atomic_store_explicit(&sampler->head, (uint8_t)(head + 1), memory_order_release);
}

bool bt_sampler_pop(bt_sampler *sampler, bt_slot *slot)
{
    uint8_t tail = atomic_load_explicit(&sampler->tail, memory_order_relaxed);
    uint8_t head = atomic_load_explicit(&sampler->head, memory_order_acquire);
    if (head == tail) {
        return false;
    }
    *slot = sampler->ring[tail % BT_SLOT_RING];
    atomic_store_explicit(&sampler->tail, (uint8_t)(tail + 1), memory_order_release);
    return true;
}

bool bt_sampler_ask(bt_sampler *sampler, uint8_t fingers, uint32_t round)
{
    if (atomic_load_explicit(&sampler->ask, memory_order_acquire) != 0) {
        return false;
    }
    sampler->ask_round = round;
    atomic_store_explicit(&sampler->ask, fingers, memory_order_release);
    return true;
}

static void begin_round(bt_sampler *sampler)
{
    uint8_t ask = atomic_load_explicit(&sampler->ask, memory_order_acquire);
    sampler->current.asked = sampler->current.queried = 0;
    if (ask == 0 || (int32_t)(sampler->current.round - sampler->ask_round) < 0) {
        return;
    }
    sampler->current.asked = sampler->current.queried = ask;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (ask >> f & 1) {
            bt_serial_query_begin(&sampler->query[f]);
            sampler->current.asked |= sampler->query[f].form == BT_FORM_HELD ? sampler->fingers : 0;
        }
    }
    atomic_store_explicit(&sampler->ask, 0, memory_order_release);
}

static void advance(bt_sampler *sampler)
{
    // 1/4400 s is 227.27 us: the fraction is carried, or the rate would drift by 0.1 %.
    sampler->slot_start_us += 1000000 / BT_SLOT_HZ;
    sampler->fraction += 1000000 % BT_SLOT_HZ;
    if (sampler->fraction >= BT_SLOT_HZ) {
        sampler->fraction -= BT_SLOT_HZ;
        sampler->slot_start_us++;
    }
    if (++sampler->current.slot == BT_SLOTS) {
        sampler->current.slot = 0;
        sampler->current.round++;
        begin_round(sampler);
    }
}

// Command every sensor at once. Returns the time to go on: once they have settled or, by hardware, been read.
static uint32_t command(bt_sampler *sampler)
{
    uint8_t code = bt_channel_command[bt_slot_channel[sampler->current.slot]];
    uint8_t mask = (uint8_t)(sampler->fingers & ~sampler->current.asked);
    sampler->commanded = true;
    sampler->current.t_us = port_now_us(sampler->port);
    if (mask == 0) { // the queried finger has the bus
        sampler->by_itself = false;
        return sampler->current.t_us + SETTLE_TICKS_US;
    }
    uint32_t busy_us = sampler->by_core ? 0 : port_spi_slot_begin(sampler->port, (uint16_t)(code << 8), mask);
    sampler->by_itself = busy_us != 0;
    if (sampler->by_itself) {
        return port_now_us(sampler->port) + busy_us;
    }
    port_spi_select(sampler->port, mask);
    // All selected sensors drive MISO at once here, so the bits mean nothing.
    (void)port_spi_transfer16(sampler->port, (uint16_t)(code << 8));
    port_spi_select(sampler->port, 0);
    return port_now_us(sampler->port) + SETTLE_TICKS_US;
}

static uint16_t read_word(const bt_sampler *sampler, uint8_t f)
{
    port_spi_select(sampler->port, (uint8_t)(1u << f));
    uint16_t word = port_spi_transfer16(sampler->port, BT_LISTEN_WORD);
    port_spi_select(sampler->port, 0);
    return word;
}

// Read the sensors one by one; absent ones read as silent. False when hardware was late: the slot is lost,
// with no word of any sensor. When every slot is late, the core does without.
static bool read_sensors(bt_sampler *sampler)
{
    bool in_time = true;
    if (sampler->by_itself) {
        in_time = port_spi_slot_end(sampler->port, sampler->current.word);
        sampler->late_in_a_row = in_time ? 0 : (uint8_t)(sampler->late_in_a_row + 1);
        sampler->by_core = sampler->late_in_a_row == BT_SLOTS;
    }
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        const bool queried = sampler->current.queried >> f & 1;
        if (sampler->by_itself && !queried) {
            continue;
        }
        sampler->current.word[f] = 0;
        if (!(sampler->fingers >> f & 1) || (sampler->current.asked >> f & 1 && !queried)) {
            continue;
        }
        if (queried) {
            bt_serial_query_step(&sampler->query[f], sampler->port, f); // waits for a byte, but only rarely
        } else {
            sampler->current.word[f] = read_word(sampler, f);
        }
        if (sampler->fingers >> f != 1) { // not the last of them
            port_delay_us(sampler->port, BT_GAP_US);
        }
    }
    return in_time;
}

uint32_t bt_sampler_alarm(bt_sampler *sampler)
{
    if (!sampler->commanded) {
        return command(sampler);
    }
    if (read_sensors(sampler)) {
        push(sampler);
    } else {
        count(&sampler->dma_late);
    }
    sampler->commanded = false;
    advance(sampler);
    // An interrupt held off for longer than a slot loses slots, but not the time base. The next command must
    // not follow the last read sooner than the bus allows.
    while ((int32_t)(sampler->slot_start_us - port_now_us(sampler->port)) <= BT_GAP_US) {
        count(&sampler->late);
        advance(sampler);
    }
    return sampler->slot_start_us;
}
