// A finger made of numbers: frames with noise, glitches, drift, a load and a pressure, for the tests
// of the tare machine. Figures are those measured on real sensors, as host/docs/develop/constants.md has
// them.
#ifndef BIOTAC_TEST_EMULATED_FINGER_H
#define BIOTAC_TEST_EMULATED_FINGER_H

#include "support.h"

#include "touch/tare.h"

#include <math.h>

#define SETTING_COUNT2 1000 // contact_energy_count2's default
#define FRAMES_PER_S   100
#define PDC_REST       1326

typedef struct {
    uint64_t seed;
    double sigma; // noise of one count
    double pdc_sigma;
    double glitch_chance; // per sample: -28..-66 counts, never two in a row
    double drift_per_s;   // counts, the same for all electrodes
    bool has_pdc;
    double t_s;
    double load;     // length of the signal over all electrodes, counts
    double pdc_load; // counts above rest
    bool glitched[BT_ELECTRODES];
    bt_tare_settings settings;
    bt_tare tare;
} emulated_finger;

// Spread of a load over the electrodes: a press on the pad with some bulge around it. The norm is 1.
static inline double load_shape(int i)
{
    static const double shape[BT_ELECTRODES] = {
        0.08, -0.30, -0.34, -0.12, -0.26, 0.06, -0.15, -0.20, -0.20, -0.24,
        0.08, -0.30, -0.34, -0.12, -0.26, 0.06, -0.38, -0.42, -0.10,
    };
    static double length;
    if (length == 0) {
        for (int k = 0; k < BT_ELECTRODES; k++) {
            length += shape[k] * shape[k];
        }
        length = sqrt(length);
    }
    return shape[i] / length;
}

static inline double rest_count(const emulated_finger *finger, int i)
{
    return 2955 + 31 * i + finger->drift_per_s * finger->t_s;
}

static inline double gauss(uint64_t *seed)
{
    double u = 1 - random_unit(seed);
    return sqrt(-2 * log(u)) * cos(2 * 3.14159265358979324 * random_unit(seed));
}

static inline uint16_t to_count(double value)
{
    return (uint16_t)(value < 1 ? 1 : value > 4089 ? 4089 : lround(value));
}

// The next frame, 10 ms after the one before.
static inline bt_round next_frame(emulated_finger *finger)
{
    bt_round frame;
    bt_round_clear(&frame);
    finger->t_s += 1.0 / FRAMES_PER_S;
    frame.t_us = (uint32_t)llround(finger->t_s * 1e6);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double value =
            rest_count(finger, i) + finger->load * load_shape(i) + finger->sigma * gauss(&finger->seed);
        bool glitch = !finger->glitched[i] && random_unit(&finger->seed) < finger->glitch_chance;
        finger->glitched[i] = glitch;
        frame.electrode[i] = to_count(value - (glitch ? (double)random_range(&finger->seed, 28, 66) : 0));
    }
    if (finger->has_pdc) {
        frame.pdc = to_count(PDC_REST + finger->pdc_load + finger->pdc_sigma * gauss(&finger->seed));
    }
    frame.good_words = 44;
    return frame;
}

// The next frame, with `value` in n electrodes from the first on.
static inline bt_round frame_without(emulated_finger *finger, int first, int n, uint16_t value)
{
    bt_round frame = next_frame(finger);
    for (int i = first; i < first + n; i++) {
        frame.electrode[i] = value;
    }
    return frame;
}

// A quiet finger with exact counts, tared by the first frames.
static inline emulated_finger new_finger(void)
{
    emulated_finger finger = {.seed = 12, .has_pdc = true};
    finger.settings.contact_energy_count2 = SETTING_COUNT2;
    bt_tare_reset(&finger.tare);
    return finger;
}

// From the next frame on.
static inline void load_by(emulated_finger *finger, double load, double pdc_load)
{
    finger->load = load;
    finger->pdc_load = pdc_load;
}

// Gives the machine one frame as the slots would; returns the first electrode that fired the trigger,
// BT_LANE_PDC for the pressure, -1 for none.
static inline int feed(emulated_finger *finger, const bt_round *frame)
{
    int touched = -1;
    bt_tare_begin(&finger->tare, &finger->settings);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        if (bt_tare_electrode(&finger->tare, i, frame->electrode[i])) {
            assert_int_equal(touched, -1); // told once
            touched = (int)i;
        }
    }
    if (bt_tare_pressure(&finger->tare, frame->pdc)) {
        assert_int_equal(touched, -1);
        touched = BT_LANE_PDC;
    }
    bt_tare_temperature(&finger->tare, frame->tdc);
    bt_tare_end(&finger->tare, frame->t_us, &finger->settings);
    return touched;
}

static inline void feed_without(emulated_finger *finger, int first, int n, uint16_t value)
{
    bt_round frame = frame_without(finger, first, n, value);
    (void)feed(finger, &frame);
}

static inline void step(emulated_finger *finger)
{
    bt_round frame = next_frame(finger);
    (void)feed(finger, &frame);
}

static inline void run_frames(emulated_finger *finger, int frames)
{
    for (int k = 0; k < frames; k++) {
        step(finger);
    }
}

static inline void run_seconds(emulated_finger *finger, double seconds)
{
    run_frames(finger, (int)lround(seconds * FRAMES_PER_S));
}

// Steps until the machine is in state; fails after limit frames. Returns the frames it took.
static inline int run_until(emulated_finger *finger, uint8_t state, int limit)
{
    for (int k = 1; k <= limit; k++) {
        step(finger);
        if (finger->tare.state == state) {
            return k;
        }
    }
    fail_msg("state %d not reached in %d frames; it is %d", state, limit, finger->tare.state);
    return 0;
}

// A finger that has rested for five seconds.
static inline emulated_finger resting_finger(void)
{
    emulated_finger finger = new_finger();
    run_seconds(&finger, 5);
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
    return finger;
}

static inline void press(emulated_finger *finger, double load, double pdc_load)
{
    load_by(finger, load, pdc_load);
    (void)run_until(finger, BT_TARE_STATE_CONTACT, 20);
}

static inline emulated_finger touched_finger(double load, double pdc_load)
{
    emulated_finger finger = resting_finger();
    press(&finger, load, pdc_load);
    return finger;
}

// Share of a signal of this length that the tare leaves: 1 when the tare is the true rest.
static inline double share_kept(const emulated_finger *finger, double load)
{
    double sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double base = finger->tare.base.electrode_q16[i] / 65536.0;
        sum += (rest_count(finger, i) + load * load_shape(i) - base) * load_shape(i);
    }
    return sum / load;
}

// Largest distance of any electrode's tare from the true rest.
static inline double tare_error(const emulated_finger *finger)
{
    double worst = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double error = fabs(finger->tare.base.electrode_q16[i] / 65536.0 - rest_count(finger, i));
        worst = error > worst ? error : worst;
    }
    return worst;
}

#endif
