// What is timed on the emulated Cortex-M0+: each kernel over the same frames, between two marks.
// The runner (count.mjs) watches for the address of bench_mark and reads the name, or at the end of a
// run the value, that it is given.
#include "bits.h"
#include "finger.h"
#include "framing.h"
#include "gold.h"
#include "lin2013.h"
#include "poc.h"
#include "results.h"
#include "wrench.h"

#include <stddef.h>

#define FRAMES 24

extern uint32_t stack_top;

static int32_t e_q4[BT_ELECTRODES];
static double e[BT_ELECTRODES];
static bt_kernel_settings settings;
static lin2013_settings exact;
static const int32_t force_nn[3] = {1063440, 252325, 2262234};
static const int32_t torque_nn[2] = {2262234, 252325};

// What keeps the compiler from dropping a result.
static volatile int32_t sink;

__attribute__((noipa, used)) void bench_mark(const char *name, uint32_t value)
{
    __asm volatile("" ::"r"(name), "r"(value) : "memory");
}

static void nothing(void)
{
    __asm volatile("" ::: "memory");
}

static void shipped(void)
{
    int16_t poc_um[3];
    int32_t force_100un[3], torque_mnmm[3];
    sink = (int32_t)bt_kernel(e_q4, &settings, BT_WANT_ALL, poc_um, force_100un, torque_mnmm);
    sink = poc_um[0] + force_100un[0] + torque_mnmm[0];
}

static void shipped_poc(void)
{
    bt_point point;
    sink = bt_poc(e_q4, settings.poc_weights, &point);
    sink = point.um[0];
}

static void shipped_force(void)
{
    int32_t force_100un[3];
    bt_force(e_q4, &settings.gains, force_100un);
    sink = force_100un[0];
}

static void shipped_torque(void)
{
    int32_t torque_mnmm[2];
    bt_torque_yz(e_q4, &settings.gains, torque_mnmm);
    sink = torque_mnmm[0];
}

static void gold(void)
{
    int32_t poc_nm[3];
    int64_t force_un[3], torque_mnmm[2];
    gold_force_un(e_q4, force_nn, force_un);
    gold_torque_yz_mnmm(e_q4, torque_nn, torque_mnmm);
    if (gold_poc(e_q4, settings.poc_weights, poc_nm)) {
        sink = (int32_t)gold_torque_x_mnmm(poc_nm, force_un);
    }
}

static void soft_double(void)
{
    lin2013_result result;
    lin2013(e, &exact, &result);
    sink = (int32_t)result.torque_nmm[0];
}

static bt_finger resting, touched;
static uint16_t rest_count[BT_SLOTS], press_count[BT_SLOTS];
static bt_msg_frame message;
static bt_tare_settings tare_settings;

static void slots(bt_finger *finger, const uint16_t count[BT_SLOTS])
{
    bt_finger_begin(finger, 0, &tare_settings);
    for (uint8_t s = 0; s < BT_SLOTS; s++) {
        sink = bt_finger_put(finger, s, count[s]);
    }
}
static void front(bt_finger *finger, const uint16_t count[BT_SLOTS])
{
    bt_tare_begin(&finger->tare, &tare_settings);
    bool touch = false;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        touch |= bt_tare_electrode(&finger->tare, i, count[2 * i]);
    }
    sink = touch;
    sink = bt_tare_pressure(&finger->tare, count[38]);
    bt_tare_end(&finger->tare, &tare_settings);
}
static void gate(void)
{
    sink = bt_gate_electrode(&resting.tare.gate, 3, 2921);
}
static void rest_tare(void)
{
    front(&resting, rest_count);
}
static void contact_tare(void)
{
    front(&touched, press_count);
}
static void rest_slots(void)
{
    slots(&resting, rest_count);
}
static void end_rest(void)
{
    sink = bt_finger_end(&resting, &tare_settings);
}
static void results_contact(void)
{
    bt_results(&touched.frame, &touched.tare, &settings, 7, &message);
}
static void contact_round(void)
{
    contact_tare();
    results_contact();
}
static void rest_round(void)
{
    rest_tare();
    sink = bt_finger_idle(&resting);
}
static uint8_t payload[BT_FRAME_BYTES], enc[BT_ENCODED_MAX_BYTES];
static void send_contact(void)
{
    bt_finger_frame(&touched, &settings, &message);
    bt_msg_frame_pack(&message, payload);
    sink = (int)bt_frame_encode(BT_FRAME_ID, payload, sizeof payload, enc);
}

// Two fingers in the middle of their lives: one untouched, one pressed half a second ago.
static void live(void)
{
    bt_settings all;
    bt_settings_reset(&all);
    tare_settings = bt_tare_settings_from(&all);
    bt_finger_reset(&resting, 0);
    for (int s = 0; s < BT_SLOTS; s++) {
        rest_count[s] = (uint16_t)(2900 + 7 * s);
        press_count[s] = (uint16_t)(rest_count[s] - (s < 38 ? 20 * (s % 13) + 40 : -100));
    }
    for (int k = 0; k < 400; k++) {
        slots(&resting, rest_count);
        sink = bt_finger_end(&resting, &tare_settings);
    }
    touched = resting;
    for (int k = 0; k < 50; k++) {
        slots(&touched, press_count);
        sink = bt_finger_end(&touched, &tare_settings);
    }
}

static void next_frame(uint32_t *seed)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        *seed = *seed * 1664525u + 1013904223u;
        // A quarter bulges a little, the rest is compressed by up to 2000 counts.
        int32_t size = (int32_t)(*seed >> 17);
        e_q4[i] = *seed & 0xC000 ? -size : size / 8;
        e[i] = e_q4[i] / 16.0;
    }
}

int main(void)
{
    static const struct {
        const char *name;
        void (*run)(void);
    } contestants[] = {
        {"nothing", nothing},
        {"shipped", shipped},
        {"shipped: PoC", shipped_poc},
        {"shipped: force", shipped_force},
        {"shipped: torque", shipped_torque},
        {"gold int64", gold},
        {"double", soft_double},
        {"gate", gate},
        {"tare: rest slots", rest_slots},
        {"tare: rest end", end_rest},
        {"tare: results", results_contact},
        {"tare: send", send_contact},
        {"tare at rest", rest_tare},
        {"tare in contact", contact_tare},
        {"whole frame at rest", rest_round},
        {"whole frame in contact", contact_round},
    };
    live();
    for (int weights = 0; weights <= 2; weights++) {
        uint32_t seed = 1;
        settings.poc_weights = weights;
        settings.gains = bt_gains_from(force_nn, torque_nn);
        exact.poc_weights = weights;
        for (int d = 0; d < 3; d++) {
            exact.force_gain[d] = force_nn[d] * 1e-9;
            exact.torque_gain[d % 2] = torque_nn[d % 2] * 1e-9;
        }
        for (int k = 0; k < FRAMES; k++) {
            next_frame(&seed);
            for (size_t c = 0; c < sizeof contestants / sizeof *contestants; c++) {
                bench_mark(contestants[c].name, 0);
                contestants[c].run();
                bench_mark(NULL, 0);
            }
        }
    }
    bench_mark("bits", 0);
    bench_mark(NULL, bits_hash());
    bench_mark("end", 0);
    for (;;) {
    }
}

void reset(void)
{
    (void)main();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[2] = {&stack_top, reset};
