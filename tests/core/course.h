// A long course of two fingers through a session, always the same; the bytes that the board wrote are kept:
// rest with noise, glitches and missing words, press, shear, release, taps, tares of all kinds, faults and
// a sensor that is away. Two sessions that differ in subscriptions alone can be compared by this course.
#ifndef BIOTAC_TEST_COURSE_H
#define BIOTAC_TEST_COURSE_H

#include "fake_host.h"

#include "emulated_finger.h"

#define COURSE_ROUNDS 1500
#define FIRST_FINGER  1
#define SECOND_FINGER 4
#define BOTH_FINGERS  (1 << FIRST_FINGER | 1 << SECOND_FINGER)
#define EVERYTHING    0x77 // every quantity there is

typedef struct {
    received_message message[MAX_RECEIVED];
    int count;
    bt_msg_status status;
} course_log;

static inline uint32_t round_t_us(int k)
{
    return 0xFFE00000u + 10000u * (uint32_t)k; // wraps under way
}

static inline uint32_t slot_t_us(int k, int slot)
{
    return round_t_us(k) + (uint32_t)(slot * 1000000 / BT_SLOT_HZ);
}

static inline bool between(int k, int from, int to)
{
    return k >= from && k < to;
}

// Load on one finger in round k. The second is 30 rounds late, so that all phases meet.
static inline bt_round course_frame(emulated_finger *finger, int k)
{
    finger->load = between(k, 300, 450) ? 3.0 * (k - 300) : between(k, 450, 600) ? 450 : 0;
    finger->pdc_load = finger->load / 2;
    if (between(k, 850, 852) || between(k, 870, 871)) {
        finger->load = 90; // taps, too short for a contact
    }
    bt_round frame = next_frame(finger);
    for (int i = 0; between(k, 500, 580) && i < BT_ELECTRODES; i++) { // shear: some rise as others fall
        frame.electrode[i] = to_count(frame.electrode[i] + 120 * sin(1.1 * i) * sin(0.1 * (k - 500)));
    }
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool missing = random_unit(&finger->seed) < 0.002 || (between(k, 1180, 1200) && i % 5 == 2);
        frame.electrode[i] = missing ? BT_INVALID_COUNT : frame.electrode[i];
    }
    frame.pdc = random_unit(&finger->seed) < 0.01 ? BT_INVALID_COUNT : frame.pdc;
    frame.tdc = (uint16_t)(random_unit(&finger->seed) < 0.01 ? BT_INVALID_COUNT : 1000 + k / 20);
    frame.tac = (uint16_t)(random_unit(&finger->seed) < 0.01 ? BT_INVALID_COUNT : 2000 + k % 7);
    return frame;
}

static inline uint16_t course_word(const bt_round *frame, uint8_t slot)
{
    unsigned channel = bt_slot_channel[slot];
    switch (channel) {
    case BT_CHANNEL_PAC:
        return 2048;
    case BT_CHANNEL_PDC:
        return frame->pdc;
    case BT_CHANNEL_TAC:
        return frame->tac;
    case BT_CHANNEL_TDC:
        return frame->tdc;
    default:
        return frame->electrode[channel - BT_CHANNEL_E1];
    }
}

static inline bool course_away(int index, int k)
{
    return index == FIRST_FINGER ? between(k, 1230, 1270) : between(k, 1240, 1250); // unplugged, and not
}

static inline void send_tare_set(uint8_t index, const emulated_finger *finger, int off)
{
    uint8_t payload[BT_TARE_SET_BYTES];
    bt_msg_tare_set msg = {.req_id = 2, .finger = index, .pdc_tare_q4 = 16 * PDC_REST};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        msg.tare_q4[i] = (uint16_t)lround(16 * (rest_count(finger, i) + off));
    }
    bt_msg_tare_set_pack(&msg, payload);
    host_send(&session, BT_TARE_SET_ID, payload, sizeof payload, 0);
}

static inline void course_commands(uint8_t index, const emulated_finger *finger, int k)
{
    uint8_t now[2] = {1, index};
    if (k == 800 || k == 820 || k == 1150) {
        host_send(&session, BT_TARE_NOW_ID, now, 2, 0);
    } else if (k == 900) {
        send_tare_set(index, finger, 3); // rest goes on
    } else if (k == 1000) {
        send_tare_set(index, finger, 25); // looks touched, until TARE_NOW
    }
}

// The whole course. room, unless NULL, is called before each round: links can be full.
static inline void run_course(uint8_t quantities, uint64_t seed, course_log *log, void (*room)(int k))
{
    static emulated_finger finger[BT_MAX_FINGERS];
    new_session();
    assert_int_equal(bt_settings_set(&session.settings, BT_SETTING_PRESSURE_GAIN_NN, 10000000), BT_ERROR_OK);
    bt_session_use_settings(&session);
    for (int f = FIRST_FINGER; f <= SECOND_FINGER; f += SECOND_FINGER - FIRST_FINGER) {
        finger[f] = new_finger();
        finger[f].seed = seed * 0x9E3779B97F4A7C15u + (unsigned)f;
        finger[f].sigma = 1.5;
        finger[f].pdc_sigma = 0.8;
        finger[f].glitch_chance = 0.003;
    }
    assert_int_equal(subscribe(BOTH_FINGERS, quantities), BT_ERROR_OK);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, BOTH_FINGERS, 0), BT_ERROR_OK);
    host_forget();
    for (int k = 0; k < COURSE_ROUNDS; k++) {
        bt_round frame[BT_MAX_FINGERS];
        for (uint8_t f = FIRST_FINGER; f <= SECOND_FINGER; f += SECOND_FINGER - FIRST_FINGER) {
            int own = f == FIRST_FINGER ? k : k - 30;
            frame[f] = course_frame(&finger[f], own);
            course_commands(f, &finger[f], own);
        }
        if (room != NULL) {
            room(k);
        }
        bt_session_begin(&session, round_t_us(k));
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            uint16_t count[BT_MAX_FINGERS];
            for (int f = 0; f < BT_MAX_FINGERS; f++) {
                bool present = (BOTH_FINGERS >> f & 1) && !course_away(f, k);
                count[f] = present ? course_word(&frame[f], slot) : BT_INVALID_COUNT;
            }
            bt_session_slot(&session, slot, count, slot_t_us(k, slot));
        }
        bt_session_end_round(&session);
    }
    assert_false(host.broken);
    host.room = SIZE_MAX;
    memcpy(log->message, host.message, sizeof log->message);
    log->count = host.count;
    bt_msg_status_unpack(&log->status, host_ask(&session, BT_GET_STATUS_ID, "\x04", 1)->payload);
}

// The head of FRAME, IDLE, TARE and TOUCH: all begin with seq, t_us and finger.
static inline bool is_from_finger(const received_message *message, int finger)
{
    return (message->id == BT_FRAME_ID || message->id == BT_IDLE_ID || message->id == BT_TARE_ID
            || message->id == BT_TOUCH_ID)
           && message->payload[6] == finger;
}

static inline uint16_t seq_at(const received_message *message)
{
    return (uint16_t)(message->payload[0] | message->payload[1] << 8);
}

// The only message of this id, finger and seq; NULL when there is none.
static inline const received_message *find_message(const course_log *log, uint8_t id, int finger,
                                                   uint16_t seq)
{
    for (int k = 0; k < log->count; k++) {
        const received_message *message = &log->message[k];
        if (message->id == id && is_from_finger(message, finger) && seq_at(message) == seq) {
            return message;
        }
    }
    return NULL;
}

#endif
