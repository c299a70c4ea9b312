// The heartbeat of an untouched finger: when it comes, which event ends the silence, how many bytes it saves.
#include "course.h"

#define FRAMES BT_STREAM_FLAG_FRAMES

static uint32_t round_number;

BEFORE_EACH(an_idle_session)
{
    new_session();
    round_number = 0;
    assert_int_equal(subscribe(1, BT_QUANTITY_FLAG_POC), BT_ERROR_OK);
}

// One round of finger 0 with these electrodes.
static void play(const uint16_t electrode[BT_ELECTRODES])
{
    uint32_t t_us = 10000 * round_number++;
    bt_session_begin(&session, t_us);
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        uint16_t count[BT_MAX_FINGERS];
        memset(count, 0xFF, sizeof count);
        unsigned channel = bt_slot_channel[slot] - BT_CHANNEL_E1;
        count[0] = channel < BT_ELECTRODES ? electrode[channel] : PDC_REST;
        count[0] = (uint16_t)(count[0] + (channel == 0 && round_number % 4 == 0)); // lest it is frozen
        bt_session_slot(&session, slot, count, t_us + slot);
    }
    bt_session_end_round(&session);
}

static void play_level(int rounds, uint16_t level)
{
    uint16_t electrode[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        electrode[i] = level;
    }
    for (int k = 0; k < rounds; k++) {
        play(electrode);
    }
}

static bt_msg_idle idle_at(int k)
{
    bt_msg_idle idle;
    assert_true(k < host.count);
    assert_int_equal(host.message[k].id, BT_IDLE_ID);
    bt_msg_idle_unpack(&idle, host.message[k].payload);
    return idle;
}

static uint16_t frame_seq_at(int k)
{
    assert_true(k < host.count);
    assert_int_equal(host.message[k].id, BT_FRAME_ID);
    return seq_at(&host.message[k]);
}

// ---- the period ------------------------------------------------------------------------------------

TEST(heartbeats_come_in_their_period)
{
    static const int32_t periods_ms[] = {20, 29, 30, 100, 250, 1000, 60000};
    for (int p = 0; p < 7; p++) {
        an_idle_session();
        assert_int_equal(set_setting(BT_SETTING_IDLE_PERIOD_MS, periods_ms[p]), BT_ERROR_OK);
        play_level(50, 2000);
        assert_int_equal(start(FRAMES, 1, 0), BT_ERROR_OK);
        host_forget();
        int rounds = periods_ms[p] / 10; // whole rounds, never later than asked
        play_level(1 + 5 * rounds, 2000);
        assert_int_equal(host.count, 1 + 5);
        assert_int_equal(frame_seq_at(0), 50);
        for (int k = 1; k <= 5; k++) {
            bt_msg_idle idle = idle_at(k);
            assert_int_equal(idle.frames, rounds);
            assert_int_equal(idle.seq, 50 + k * rounds);
            assert_int_equal(idle.t_us, 10000 * (50 + k * rounds));
            assert_int_equal(idle.finger, 0);
            assert_in_range(idle.energy_count2, 0, 1);
        }
    }
}

TEST(a_start_is_answered_with_a_frame_at_every_phase)
{
    play_level(50, 2000);
    for (int phase = 0; phase < 40; phase++) {
        assert_int_equal(start(FRAMES, 1, 0), BT_ERROR_OK);
        host_forget();
        uint16_t seq = session.finger[0].seq;
        play_level(1 + phase, 2000);
        assert_int_equal(frame_seq_at(0), seq);
        for (int k = 1; k < host.count; k++) { // and no message from before the START again
            assert_int_equal(idle_at(k).seq, seq + 10 * k);
            assert_int_equal(idle_at(k).frames, 10);
        }
        assert_int_equal(host.count, 1 + phase / 10);
        if (phase % 2) {
            assert_int_equal(stop(), BT_ERROR_OK);
            play_level(3, 2000);
        }
    }
}

// seq equals that of the wrench again after 655.36 s.
TEST(a_wrench_from_before_a_rest_is_never_repeated)
{
    static const bt_map map;
    const bt_solve_settings mapped = {.map = &map};
    bt_finger *finger = &session.finger[0];
    play_level(50, 2000);
    assert_int_equal(start(FRAMES, 1, 0), BT_ERROR_OK);
    play_level(1, 2000);
    finger->kept = (bt_kept_wrench){.valid = true, .seq = (uint16_t)(finger->seq - 1)};
    assert_int_equal(bt_finger_wrench_age(finger, &mapped), 0);
    play_level(65536, 2000);
    assert_true(bt_finger_wrench_age(finger, &mapped) > BT_REPEAT_MAX_ROUNDS);
}

// ---- the end of the silence ------------------------------------------------------------------------

TEST(a_rest_that_has_moved_beyond_noise_is_shown)
{
    play_level(50, 2000);
    assert_int_equal(start(FRAMES, 1, 0), BT_ERROR_OK);
    host_forget();
    play_level(1, 2000);
    // A count every four seconds, which the tare follows. 19 d^2 passes 1000 with d = 8.
    int since = 0, frames = 1, last = 2000;
    for (int k = 1; k <= 400 * 40; k++) {
        int level = 2000 + k / 400;
        int before = host.count;
        play_level(1, (uint16_t)level);
        since++;
        bool heartbeat = since == 10;
        if (heartbeat && 19 * (level - last) * (level - last) > 1000) {
            assert_int_equal(host.count, before + 2);
            assert_int_equal(idle_at(before).frames, 9);
            assert_int_equal(idle_at(before).seq, 50 + k - 1);
            assert_int_equal(frame_seq_at(before + 1), 50 + k);
            last = level;
            frames++;
            since = 0;
        } else if (heartbeat) {
            assert_int_equal(host.count, before + 1);
            assert_int_equal(idle_at(before).seq, 50 + k);
            since = 0;
        } else {
            assert_int_equal(host.count, before);
        }
    }
    assert_int_equal(session.finger[0].tare.state, BT_TARE_STATE_REST);
    assert_int_equal(frames, 1 + 40 / 8);
}

// ---- subscriptions ---------------------------------------------------------------------------------

TEST(unknown_fingers_are_refused_and_change_nothing)
{
    for (int fingers = 0; fingers < 256; fingers++) {
        for (int k = 0; k < 256; k += 17) {
            int quantities = k & (int)BT_QUANTITY_FLAGS;
            uint8_t before[BT_MAX_FINGERS];
            uint8_t error = fingers >> 5 ? BT_ERROR_NO_SUCH_FINGER : BT_ERROR_OK;
            for (int f = 0; f < BT_MAX_FINGERS; f++) {
                before[f] = session.finger[f].quantities;
            }
            assert_int_equal(subscribe((uint8_t)fingers, (uint8_t)quantities), error);
            for (int f = 0; f < BT_MAX_FINGERS; f++) {
                bool named = error == BT_ERROR_OK && fingers >> f & 1;
                assert_int_equal(session.finger[f].quantities, named ? quantities : before[f]);
            }
        }
    }
}

// Noise and glitches of the worst sensor there is.
TEST(a_noisy_finger_at_rest_is_as_silent)
{
    emulated_finger finger = new_finger();
    finger.sigma = 5;
    finger.glitch_chance = 0.005;
    assert_int_equal(start(FRAMES, 1, 0), BT_ERROR_OK);
    for (int k = 0; k < 1500; k++) {
        bt_round frame = next_frame(&finger);
        play(frame.electrode);
        if (k == 500) {
            host_forget();
        }
    }
    assert_int_equal(session.finger[0].tare.state, BT_TARE_STATE_REST);
    assert_in_range(host_count(BT_FRAME_ID), 0, 100);
}
