// The sampling interrupt on a thread of its own, the main loop on another, ThreadSanitizer between them:
// every location that both touch without an atomic's order is reported. On one core an interrupt never runs
// at the same time; the order that it needs is the same.
//
//   test_interrupt            exit 0: no data race
//   test_interrupt --defect   the main loop looks at the interrupt's own data, which must be told
#include "rig.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>

#define END_NS       (500 * ROUND_NS)
#define AHEAD_ALARMS 200 // alarms that the interrupt may be ahead of the main loop: some slots are lost then
#define AWAY_FROM    200 // rounds without finger 2, so that it is asked for its serial
#define AWAY_TO      300

// Relaxed, as the port's clock is: they must not lend their order to the watched data.
static _Atomic uint32_t alarms, seen_alarms; // those that were, and of those the main loop came after

static uint32_t load_relaxed(_Atomic uint32_t *count)
{
    return atomic_load_explicit(count, memory_order_relaxed);
}

static bool is_over(void)
{
    return atomic_load_explicit(&fake.now_ns, memory_order_relaxed) >= END_NS;
}

static bool away; // finger 2 has been; the interrupt's

static uint16_t away_for_a_second(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    const uint64_t round = t_ns / ROUND_NS;
    if (round < AWAY_FROM || round >= AWAY_TO) {
        return source(context, finger, channel, t_ns);
    }
    away = true;
    return BT_EMU_FAULT_UNPLUGGED;
}

static void *interrupts(void *nothing)
{
    while (!is_over()) {
        while (load_relaxed(&alarms) - load_relaxed(&seen_alarms) > AHEAD_ALARMS) {
        }
        (void)fake_next_interrupt();
        atomic_store_explicit(&alarms, load_relaxed(&alarms) + 1, memory_order_relaxed);
    }
    return nothing;
}

int main(int argc, char **argv)
{
    bool defect = argc > 1 && strcmp(argv[1], "--defect") == 0;
    uint32_t looked = 0;
    int frames = 0;
    boot(START_NS);
    fake.bus.sensor[2].source = away_for_a_second;
    pthread_t thread;
    if (pthread_create(&thread, NULL, interrupts, NULL) != 0) {
        return 2;
    }
    while (!is_over()) {
        uint32_t before = load_relaxed(&alarms);
        bt_gateway_poll(&gateway);
        looked += defect ? gateway.sampler.fraction : 0;
        atomic_store_explicit(&seen_alarms, before, memory_order_relaxed);
    }
    (void)pthread_join(thread, NULL);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        frames += host.frames[f];
    }
    bool asked = away && !fake.bus.sensor[2].mute; // until it is asked for its serial
    printf("%d frames, %u slots late, %u%s\n", frames, gateway.session.status.slots_late, looked,
           asked ? ", finger 2 was asked who it is" : "");
    return frames < BT_MAX_FINGERS * 500 / 2 || !asked;
}
