// One number over many results of the shipped kernels, and over a whole finger's results: equal on every
// build that computes the same bits. Frames run through every size and both signs by a fixed generator,
// BITS_FRAMES of them.
#ifndef BIOTAC_BENCH_BITS_H
#define BIOTAC_BENCH_BITS_H

#include "finger.h"
#include "map/population.h"
#include "maps.h"
#include "signal/signals.h"
#include "solve/solve.h"
#include "wire/crc32.h"

#include <string.h>

#define BITS_MAP_FRAMES 2000

// A wrench map of all seven axes, and the population map, over counts and tares of the whole range, missing
// ones among them.
static inline uint32_t bits_map_hash(void)
{
    static bench_map whole;
    uint32_t seed = 11;
    uint32_t chain[8] = {0};
    if (!BENCH_MAP_MAKE(&whole, bench_map_pooled, BT_MAP_AXES_MAX)) {
        return 0;
    }
    for (int k = 0; k < BITS_MAP_FRAMES; k++) {
        uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
        uint32_t spread = 65521u >> (k % 12);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            tare_q4[i] = (uint16_t)(65520 - bench_step(&seed) % (k % 3 == 0 ? 65521u : 30000u));
            uint32_t moved = (uint32_t)tare_q4[i] + bench_step(&seed) % spread;
            counts[i] = (uint16_t)((moved > spread / 2 ? moved - spread / 2 : 0) / 16 % 4096);
            if (bench_step(&seed) % 64 == 0) {
                counts[i] = BT_INVALID_COUNT;
            }
        }
        int32_t pdc_q4 = (int32_t)(bench_step(&seed) % 65521u) - 20000;
        bt_map_wrench(&whole.map, counts, tare_q4, pdc_q4, (int32_t *)chain + 1, (int32_t *)chain + 4,
                      (int32_t *)chain + 7);
        int32_t e_q4[BT_ELECTRODES], population_100un[3];
        bt_signals_q4(counts, tare_q4, e_q4);
        bt_population_force(&bt_population, e_q4, population_100un);
        chain[0] = bt_crc32((const uint8_t *)population_100un, sizeof population_100un) ^ chain[0];
        chain[0] = bt_crc32((const uint8_t *)chain, sizeof chain);
    }
    return chain[0];
}

#define BITS_ROUNDS 300

// A word of a finger that rests, is pressed and let go, slips, and now and then does not answer.
static inline uint16_t bits_word(uint32_t *seed, int round, uint8_t slot)
{
    const uint32_t noise = bench_step(seed);
    const int phase = round % 60;
    const int pressed = phase < 25 ? 0 : phase < 35 ? (phase - 25) * 12 : phase < 50 ? 120 : 0;
    const uint8_t channel = bt_slot_channel[slot];
    if (noise % 1021 == 0) {
        return BT_INVALID_COUNT;
    }
    if (channel == BT_CHANNEL_PAC) {
        uint32_t swing = phase >= 40 && phase < 48 ? 160 : 6;
        return (uint16_t)(2038 + (int)(noise % (2 * swing)) - (int)swing);
    }
    int at = channel - BT_CHANNEL_E1;
    int more = at >= 0 ? (at % 5 - 2) * pressed : channel == BT_CHANNEL_PDC ? pressed : 0;
    return (uint16_t)(2000 + more + (int)(noise % 5));
}

static inline void bits_add(uint32_t *chain, const uint8_t *payload, size_t bytes)
{
    *chain = *chain * 31 ^ bt_crc32(payload, bytes);
}

// A hash of a finger's results in every round, standard deviations included, and of EVENTs.
static inline uint32_t bits_finger_hash(void)
{
    static bt_finger finger;
    uint32_t seed = 23, chain = 0;
    bt_settings all;
    bt_settings_reset(&all);
    const bt_solve_settings solve = bt_solve_settings_from(&all);
    const bt_tare_settings tare = bt_tare_settings_from(&all);
    bt_finger_reset(&finger, 0);
    finger.quantities = 0xFF;
    for (int round = 0; round < BITS_ROUNDS; round++) {
        const uint32_t t_us = (uint32_t)round * 10000;
        uint8_t payload[BT_FRAME_BYTES];
        bt_finger_begin(&finger, t_us, &tare);
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            bool touched = bt_finger_put(&finger, slot, bits_word(&seed, round, slot));
            uint32_t raised = bt_finger_events(&finger, slot, touched);
            for (uint8_t event = 0; raised != 0; event++, raised >>= 1) {
                if (raised & 1) {
                    bt_msg_event msg;
                    bt_finger_event(&finger, event, slot, t_us, &msg);
                    bt_msg_event_pack(&msg, payload);
                    bits_add(&chain, payload, BT_EVENT_BYTES);
                }
            }
        }
        if (bt_finger_end(&finger, &tare)) {
            bt_msg_frame msg;
            bt_finger_frame(&finger, &solve, finger.quantities, 0, &msg);
            bt_msg_frame_pack(&msg, payload);
            bits_add(&chain, payload, BT_FRAME_BYTES);
        }
    }
    return chain;
}

static inline uint32_t bits_hash(void)
{
    uint32_t seed = 7;
    uint32_t chain[8] = {bits_map_hash() ^ bits_finger_hash()};
    bt_settings all;
    bt_settings_reset(&all);
    bt_solve_settings settings = bt_solve_settings_from(&all);
    for (int k = 0; k < BITS_FRAMES; k++) {
        int32_t e_q4[BT_ELECTRODES];
        int16_t poc_um[3];
        int32_t force_100un[3], torque_mnmm[3];
        int32_t size = BT_E_MAX_Q4 >> (k % 16);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            int32_t magnitude = (int32_t)(bench_step(&seed) % (uint32_t)(size + 1));
            e_q4[i] = bench_step(&seed) & 3 ? -magnitude : magnitude;
        }
        settings.poc_weights = k % 3;
        uint32_t flags = bt_solve(e_q4, &settings, BT_WANT_ALL, poc_um, force_100un, torque_mnmm, NULL);
        for (int d = 0; d < 3; d++) {
            chain[1 + d] = (uint32_t)force_100un[d];
            chain[4 + d] = (uint32_t)torque_mnmm[d] ^ (uint32_t)(uint16_t)poc_um[d] << 16;
        }
        chain[7] = flags;
        chain[0] = bt_crc32((const uint8_t *)chain, sizeof chain); // both builds are little-endian
    }
    return chain[0];
}

#endif
