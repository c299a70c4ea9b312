// Events of one finger, fed word by word: which event is told, in which slot, and which is not.
#include "../emulated_finger.h"

#include "finger.h"

#define MAX_SENT      4096
#define SLOT_US(slot) ((uint32_t)((slot) * 1000000u / BT_SLOT_HZ))

typedef struct {
    bt_finger finger;
    bt_tare_settings settings;
    uint64_t seed;
    uint32_t t_us;
    double sigma; // of electrodes and PAC
    double pac_sigma;
    double load; // counts, over all electrodes
    uint16_t pdc;
    double pac[BT_PAC_PER_FRAME]; // above rest, of the coming round
    int good_until;               // words from this slot on are missing
    bt_msg_event sent[MAX_SENT];
    int count;
} course;

static course run;

BEFORE_EACH(new_course)
{
    memset(&run, 0, sizeof run);
    run.seed = 7;
    run.pdc = PDC_REST;
    run.pac_sigma = 4;
    run.good_until = BT_SLOTS;
    run.settings.contact_energy_count2 = SETTING_COUNT2;
    bt_finger_reset(&run.finger, 2);
}

static uint16_t word(unsigned slot)
{
    unsigned channel = bt_slot_channel[slot];
    unsigned electrode = channel - BT_CHANNEL_E1;
    if (electrode < BT_ELECTRODES) {
        return to_count(2955 + 31 * electrode + run.load * load_shape((int)electrode)
                        + run.sigma * gauss(&run.seed));
    }
    if (channel == BT_CHANNEL_PAC) {
        return to_count(2038 + run.pac[bt_slot_pac[slot]] + run.pac_sigma * gauss(&run.seed));
    }
    return channel == BT_CHANNEL_PDC ? run.pdc : 2000;
}

static void collect(uint32_t due, uint8_t slot)
{
    for (uint8_t event = BT_EVENT_KIND_TOUCH; event <= BT_EVENT_KIND_STUCK; event++) {
        if (due >> event & 1) {
            bt_msg_event *msg = &run.sent[run.count++];
            assert_true(run.count < MAX_SENT);
            bt_finger_event(&run.finger, event, slot, run.t_us + SLOT_US(slot), msg);
            assert_int_equal(msg->slot, slot);
            assert_int_equal(msg->finger, 2);
            assert_int_equal(msg->t_us, run.t_us + SLOT_US(slot));
            due &= ~(1u << event);
        }
    }
    assert_int_equal(due, 0);
}

static void play(int rounds)
{
    for (int k = 0; k < rounds; k++) {
        bt_finger_begin(&run.finger, run.t_us, &run.settings);
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            uint16_t count = slot < run.good_until ? word(slot) : BT_INVALID_COUNT;
            bool touched = bt_finger_put(&run.finger, slot, count);
            collect(bt_finger_events(&run.finger, slot, touched), slot); // most slots are not due
        }
        (void)bt_finger_end(&run.finger, &run.settings);
        run.t_us += BT_FRAME_MS * 1000;
    }
}

static int count_of(uint8_t event)
{
    int n = 0;
    for (int k = 0; k < run.count; k++) {
        n += run.sent[k].kind == event;
    }
    return n;
}

static const bt_msg_event *first(uint8_t event)
{
    for (int k = 0; k < run.count; k++) {
        if (run.sent[k].kind == event) {
            return &run.sent[k];
        }
    }
    fail_msg("event %d was not told", event);
    return NULL;
}

// Tared, then held with half a second of quiet.
static void hold(void)
{
    play(300);
    run.load = 120;
    run.pdc = PDC_REST + 60;
    play(50);
    run.count = 0;
}

TEST(touch_and_lift_are_told_in_the_slot_that_shows_them)
{
    play(300);
    assert_int_equal(run.count, 0);
    const uint32_t pressed_us = run.t_us;
    run.load = 200;
    play(20);
    assert_int_equal(count_of(BT_EVENT_KIND_TOUCH), 1);
    const bt_msg_event *touch = first(BT_EVENT_KIND_TOUCH);
    assert_in_range(touch->t_us, pressed_us, pressed_us + 20000); // a far word waits for the second one
    assert_int_equal(touch->onset_us, touch->t_us);
    assert_in_range(touch->energy_count2, SETTING_COUNT2, 200 * 200 * 2);
    assert_int_equal(touch->peak_count, BT_INVALID_COUNT);
    assert_int_equal(count_of(BT_EVENT_KIND_LIFT), 0);
    const uint32_t released_us = run.t_us;
    run.load = 0;
    play(100);
    assert_int_equal(count_of(BT_EVENT_KIND_LIFT), 1);
    assert_in_range(first(BT_EVENT_KIND_LIFT)->t_us, released_us, released_us + 20000);
    assert_in_range(first(BT_EVENT_KIND_LIFT)->energy_count2, 0, SETTING_COUNT2 / 2);
    assert_int_equal(count_of(BT_EVENT_KIND_TOUCH), 1);
}

// The tare machine waits for a whole sweep before it ends a contact; a tap on the pad is shorter.
TEST(touches_in_quick_succession_are_all_told)
{
    play(300);
    for (int k = 0; k < 10; k++) {
        run.load = 200;
        play(8);
        run.load = 0;
        play(8);
    }
    assert_int_equal(count_of(BT_EVENT_KIND_TOUCH), 10);
    assert_int_equal(count_of(BT_EVENT_KIND_LIFT), 10);
}

TEST(pressure_that_stays_is_no_lift)
{
    hold();
    run.load = 0;
    play(20);
    assert_int_equal(count_of(BT_EVENT_KIND_LIFT), 0);
    run.pdc = PDC_REST;
    play(3);
    assert_int_equal(count_of(BT_EVENT_KIND_LIFT), 1);
}

TEST(a_resting_worn_finger_tells_nothing)
{
    run.pac_sigma = 5;
    run.sigma = 5;
    play(6000);
    assert_int_equal(run.count, 0);
}

TEST(missing_words_are_no_event)
{
    hold();
    for (int k = 0; k < 40; k++) {
        run.good_until = k % 3 ? BT_SLOTS : k;
        play(1);
    }
    assert_int_equal(run.count, 0);
}

// The widest words: nothing wraps (the sanitizers look on), and each begun slip ends.
TEST(the_rails_do_not_wrap)
{
    play(300);
    for (int k = 0; k < 400; k++) {
        run.load = k % 40 < 30 ? 4000 : 0;
        for (int i = 0; i < BT_PAC_PER_FRAME; i++) {
            run.pac[i] = (double)random_range(&run.seed, -4000, 4000);
        }
        play(1);
    }
    memset(run.pac, 0, sizeof run.pac);
    run.load = 0;
    play(400);
    assert_int_equal(count_of(BT_EVENT_KIND_SLIP), count_of(BT_EVENT_KIND_STUCK));
    assert_int_equal(count_of(BT_EVENT_KIND_TOUCH), count_of(BT_EVENT_KIND_LIFT));
}

// A touch may first be felt by the pressure alone; the release is told all the same.
TEST(a_touch_that_no_electrode_shows_ends)
{
    bt_events events;
    bt_events_reset(&events);
    const bt_tare tare = {.threshold_count2 = SETTING_COUNT2};
    assert_int_equal(bt_events_touch(&events, &tare), 1 << BT_EVENT_KIND_TOUCH);
    assert_int_not_equal(events.strongest_slot, BT_EVENTS_NO_SLOT);
    assert_int_equal(bt_events_lift(&events, &tare), 1 << BT_EVENT_KIND_LIFT);
}
