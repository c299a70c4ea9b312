// The evidence of events by hand: one stretch of samples at a time, at the edges of every limit.
#include "../emulated_finger.h"

#include "events/events.h"

#define LEVEL       100
#define TOLL        (8 * LEVEL / 2) // that noise takes of each side in a stretch of eight samples
#define TOLD(event) (1u << BT_EVENT_KIND_##event)

static bt_tare tare;
static uint16_t pac[BT_PAC_PER_FRAME];
static bt_events events;

static int held(void **state)
{
    (void)state;
    memset(&tare, 0, sizeof tare);
    tare.state = BT_TARE_STATE_CONTACT;
    tare.threshold_count2 = SETTING_COUNT2;
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        pac[k] = 2000;
    }
    bt_events_reset(&events);
    assert_int_equal(events.level_count2, LEVEL);
    events.touched = true;
    events.now = 100000;
    return 0;
}

// The second stretch of a round, eight samples that do not change anything; returns what is told.
static uint32_t stretch(void)
{
    events.samples_done = 8;
    return bt_events_pac(&events, &tare, pac, 16);
}

// The same with this much evidence left after it.
static uint32_t shaken(uint32_t risen_count2, uint32_t fallen_count2)
{
    events.risen_count2 = risen_count2 + TOLL;
    events.fallen_count2 = fallen_count2 + (fallen_count2 > 0 ? TOLL : 0);
    uint32_t told = stretch();
    assert_int_equal(events.risen_count2, risen_count2);
    assert_int_equal(events.fallen_count2, fallen_count2);
    return told;
}

TEST(a_slip_goes_both_ways_by_more_than_twenty_levels)
{
    static const struct {
        uint32_t risen, fallen, told;
    } cases[] = {{2000, 2001, 0}, {2001, 2000, 0}, {2001, 2001, TOLD(SLIP)}};
    for (int k = 0; k < 3; k++) {
        (void)held(NULL);
        events.jolt_raised = true;
        assert_int_equal(shaken(cases[k].risen, cases[k].fallen), cases[k].told);
        assert_int_equal(events.slipping, cases[k].told != 0);
        (void)held(NULL);
        events.touched = false;
        tare.state = BT_TARE_STATE_REST;
        assert_int_equal(shaken(cases[k].risen, cases[k].fallen), TOLD(JOLT)); // nobody slips untouched
    }
}

TEST(a_jolt_is_more_than_25_levels_and_told_once)
{
    assert_int_equal(shaken(2500, 0), 0);
    assert_int_equal(shaken(1250, 1250), 0);
    assert_int_equal(shaken(2501, 0), TOLD(JOLT));
    assert_int_equal(shaken(5000, 0), 0);
    assert_int_equal(shaken(1, 0), 0);
    events.risen_count2 = TOLL;
    events.fallen_count2 = 0;
    assert_int_equal(stretch(), 0); // over: the next one is another
    assert_int_equal(shaken(2501, 0), TOLD(JOLT));
}

// Where the other side shakes already, nothing was passed over as noise before the first word.
TEST(a_side_begins_at_the_first_sample_that_moved_its_way)
{
    static const uint16_t words[8] = {BT_INVALID_COUNT, 2000, 2100, 2000, 1900, 2100, 1900, 2000};
    memcpy(pac + 8, words, sizeof words);
    events.risen_count2 = 1;
    (void)stretch();
    assert_int_equal(events.fall_began, 100000 + 4);
    (void)held(NULL);
    memcpy(pac + 8, words, sizeof words);
    events.fallen_count2 = 1;
    (void)stretch();
    assert_int_equal(events.rise_began, 100000 + 2);
}

// A stretch of changes, none of them below the noise; twelve levels are the most of a sample.
TEST(while_it_slips_both_sides_are_one)
{
    static const int change[8] = {30, -34, 35, -100, 10, -20, 0, 5};
    events.slipping = true;
    events.risen_count2 = 3000;
    events.fallen_count2 = 700;
    for (int k = 0; k < 8; k++) {
        pac[8 + k] = (uint16_t)(2000 + change[k]);
    }
    const uint32_t all = 30 * 30 + 34 * 34 + 1200 + 1200 + 10 * 10 + 20 * 20 + 5 * 5;
    assert_int_equal(stretch(), 0);
    assert_int_equal(events.risen_count2, 3700 + all - 8 * LEVEL);
    assert_int_equal(events.fallen_count2, 0);
    assert_int_equal(events.round_sum_count2, all);
    (void)held(NULL);
    events.slipping = true;
    events.risen_count2 = 20000 + 800;
    (void)stretch();
    assert_int_equal(events.risen_count2, 20000);
    events.risen_count2 = 20001 + 800;
    (void)stretch();
    assert_int_equal(events.risen_count2, 20000);
    events.risen_count2 = 801;
    assert_int_equal(stretch(), 0);
    assert_true(events.slipping);
    events.risen_count2 = 800;
    assert_int_equal(stretch(), TOLD(STUCK));
    assert_false(events.slipping || events.jolt_raised);
    assert_int_equal(stretch(), 0);
}

TEST(what_was_told_of_shakes_on_until_it_is_over)
{
    static const struct {
        bool jolt_raised, landing, touched, one;
    } cases[] = {{true, true, true, true},
                 {true, false, true, false},
                 {true, false, false, true},
                 {false, true, true, false},
                 {false, false, false, false}};
    for (int k = 0; k < 5; k++) {
        (void)held(NULL);
        tare.state = BT_TARE_STATE_REST;
        events.touch_began = events.now;
        events.jolt_raised = cases[k].jolt_raised;
        events.landing = cases[k].landing;
        events.touched = cases[k].touched;
        events.risen_count2 = events.fallen_count2 = 1000;
        (void)stretch();
        assert_int_equal(events.risen_count2, cases[k].one ? 2000 - 8 * LEVEL : 1000 - TOLL);
        assert_int_equal(events.fallen_count2, cases[k].one ? 0 : 1000 - TOLL);
    }
}

// For a tenth of a second after a touch, and as long as it shakes for a second, it lands.
TEST(what_has_just_been_touched_lands)
{
    for (uint32_t since = 219; since <= 220; since++) {
        (void)held(NULL);
        events.landing = true;
        events.touch_began = events.now + 8 - since;
        (void)stretch(); // does not shake
        assert_int_equal(events.landing, since < 220);
    }
    for (uint32_t since = 2199; since <= 2200; since++) {
        (void)held(NULL);
        events.landing = true;
        events.touch_began = events.now + 8 - since;
        assert_int_equal(shaken(2001, 2001), since < 2200 ? TOLD(JOLT) : TOLD(JOLT) | TOLD(SLIP));
        assert_int_equal(events.landing, since < 2200);
    }
}

// A drag: the last sample of a stretch has changed by 75 counts, for 44 samples.
TEST(a_drag_is_a_slip_of_one_sign)
{
    for (int change = 74; change <= 75; change++) {
        (void)held(NULL);
        for (int round = 0; round < 6; round++) {
            for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
                pac[k] = (uint16_t)(k < 8 ? 2000 : 2000 + change);
            }
            events.dragged = round == 0 ? 0 : events.dragged;
            const uint32_t told = stretch() & ~TOLD(JOLT);
            assert_int_equal(events.dragged, change < 75 ? 0 : 8 * (round + 1));
            assert_int_equal(told, change == 75 && round == 5 ? TOLD(SLIP) : 0);
        }
        assert_true(change < 75 || events.slip_began == events.now - 1);
    }
    (void)held(NULL);
    events.jolt_raised = true;
    events.dragged = 43;
    assert_int_equal(shaken(100, 0), 0);
    events.dragged = 44;
    assert_int_equal(shaken(100, 0), TOLD(SLIP));
}

// Rise and fall within 18 samples are one vibration, which began with the earlier; else with the later.
TEST(a_slip_began_with_its_vibration)
{
    static const struct {
        int32_t fall_after_rise;
        bool with_rise;
    } cases[] = {{18, true}, {19, false}, {1, true}, {-1, false}, {-18, false}, {-19, true}};
    for (int k = 0; k < 6; k++) {
        (void)held(NULL);
        events.jolt_raised = true;
        events.rise_began = 99000;
        events.fall_began = 99000 + (uint32_t)cases[k].fall_after_rise;
        assert_int_equal(shaken(2001, 2001), TOLD(SLIP));
        assert_int_equal(events.slip_began, cases[k].with_rise ? events.rise_began : events.fall_began);
    }
}

TEST(noise_is_half_a_level_and_no_more)
{
    events.level_count2 = 98;
    pac[12] = 2007; // 49
    (void)stretch();
    assert_true(events.risen_count2 == 0 && events.round_sum_count2 == 49);
    pac[14] = 2020; // what is no more than that is before it begins
    (void)stretch();
    assert_int_equal(events.risen_count2, 400 - 2 * 49);
    assert_int_equal(events.shake_began, events.now - 2);
    (void)held(NULL);
    events.level_count2 = 98;
    pac[12] = 2008;
    (void)stretch();
    assert_int_equal(events.risen_count2, 0); // four samples of noise take it away again
    pac[12] = 2020;
    events.dragged = 9;
    events.peak_count2 = 1000000;
    (void)stretch();
    assert_int_equal(events.risen_count2, 400 - 4 * 49);
    assert_int_equal(events.peak_count2, 400); // not of what shook before
    assert_int_equal(events.dragged, 0);
    assert_int_equal(events.shake_began, events.now - 4);
    assert_int_equal(events.rise_began, events.now - 4);
}

// A round that was begun late is compared within itself.
TEST(a_first_stretch_that_was_missed_is_no_change)
{
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        pac[k] = (uint16_t)(k < 8 ? 2000 + k : k < 16 ? 2003 + k - 8 : 3000);
    }
    events.samples_done = 0;
    (void)bt_events_pac(&events, &tare, pac, 16);
    assert_int_equal(events.round_sum_count2, 8 * 3 * 3);
    assert_int_equal(events.now, 100016);
    events.samples_done = 16; // of a round whose end was not shown
    (void)bt_events_pac(&events, &tare, pac, 16);
    assert_int_equal(events.round_sum_count2, 2 * 8 * 3 * 3);
}

// Two samples' share of a round's noise, as a mean over many rounds at rest, within limits.
TEST(the_level_is_the_noise_at_rest)
{
    enum { AT_REST, TOUCHED, UNTARED, STATES };
    static const struct {
        uint32_t round_sum_count2, level_count2;
    } cases[] = {{100, 100}, {11000, 1000}, {50000, 3200}};
    for (int k = 0; k < 3 * STATES; k++) {
        (void)held(NULL);
        tare.state = k % STATES == UNTARED ? BT_TARE_STATE_INIT : BT_TARE_STATE_REST;
        events.touched = k % STATES == TOUCHED;
        for (int rounds = 0; rounds < 1000; rounds++) {
            events.round_sum_count2 = cases[k / STATES].round_sum_count2;
            events.samples_done = 16;
            (void)bt_events_pac(&events, &tare, pac, BT_PAC_PER_FRAME);
            assert_true(events.round_sum_count2 == 0 && events.samples_done == 0);
        }
        const uint32_t level = k % STATES == AT_REST ? cases[k / STATES].level_count2 : LEVEL;
        assert_in_range(events.level_count2, level - level / 100, level + level / 100);
    }
}

// ---- touches ---------------------------------------------------------------------------------------

static uint8_t slot_of(unsigned electrode)
{
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        if (bt_slot_channel[slot] == BT_CHANNEL_E1 + electrode) {
            return slot;
        }
    }
    return BT_SLOTS;
}

TEST(the_strongest_electrode_is_watched_until_half_is_gone)
{
    for (unsigned strong = 0; strong < BT_ELECTRODES; strong++) {
        (void)held(NULL);
        events.touched = false;
        tare.threshold_count2 = 200;
        for (unsigned i = 0; i < BT_ELECTRODES; i++) {
            tare.trigger.rest.lane[i] = 3000;
            tare.trigger.smooth.lane[i] =
                (uint16_t)(i == strong ? 3000 - 10 : 3000 + (i == (strong + 1) % 19));
        }
        tare.trigger.rest.lane[BT_LANE_PDC] = tare.trigger.smooth.lane[BT_LANE_PDC] = 1000;
        assert_int_equal(bt_events_touch(&events, &tare), TOLD(TOUCH));
        assert_int_equal(bt_events_touch(&events, &tare), 0); // told once
        assert_true(events.touched && events.landing && events.touch_began == events.now);
        assert_int_equal(events.energy_count2, 101);
        assert_int_equal(events.watched, slot_of(strong));
        assert_int_equal(bt_events_watch(&events, &tare), 0); // one more than half
        tare.trigger.smooth.lane[(strong + 1) % 19] = 3000;
        tare.trigger.smooth.lane[BT_LANE_PDC] = 1007;
        assert_int_equal(bt_events_watch(&events, &tare), 0); // still pressed
        tare.trigger.smooth.lane[BT_LANE_PDC] = 1006;
        assert_int_equal(bt_events_watch(&events, &tare), TOLD(LIFT));
        assert_false(events.touched);
        assert_int_equal(events.watched, BT_EVENTS_NO_SLOT);
        // The tare machine calls it a contact still: touched again above the threshold.
        tare.threshold_count2 = 100;
        assert_int_equal(stretch(), 0);
        assert_int_equal(events.watched, BT_EVENTS_NO_SLOT);
        tare.threshold_count2 = 99;
        assert_int_equal(stretch(), TOLD(TOUCH));
        assert_int_equal(events.watched, slot_of(strong));
        tare.trigger.smooth.lane[BT_LANE_PDC] = 2000;
        tare.trigger.rest.lane[BT_LANE_PDC] = 0; // unknown
        tare.threshold_count2 = 200;
        assert_int_equal(bt_events_watch(&events, &tare), TOLD(LIFT));
    }
}

// ---- messages --------------------------------------------------------------------------------------

static bt_msg_event message(uint8_t event)
{
    bt_msg_event msg;
    bt_events_message(&events, event, &tare, 5000000, &msg);
    assert_int_equal(msg.kind, event);
    assert_int_equal(msg.t_us, 5000000);
    assert_int_equal(msg.tare_state, tare.state);
    return msg;
}

TEST(an_onset_is_told_in_samples_of_2200_a_second)
{
    events.energy_count2 = 77;
    for (uint32_t ago = 0; ago < 500; ago++) {
        events.shake_began = events.slip_began = events.now - 1 - ago;
        events.peak_count2 = 0;
        bt_msg_event jolt = message(BT_EVENT_KIND_JOLT), slip = message(BT_EVENT_KIND_SLIP);
        assert_true(fabs(5000000.0 - jolt.onset_us - ago * 1e6 / 2200) <= 1);
        assert_int_equal(slip.onset_us, jolt.onset_us);
        assert_int_equal(message(BT_EVENT_KIND_STUCK).onset_us, slip.onset_us);
        assert_int_equal(jolt.energy_count2, UINT32_MAX);
    }
    static const uint32_t squares[][2] = {{0, 0}, {1, 1}, {399, 19}, {400, 20}, {4095 * 4095, 4095}};
    for (int k = 0; k < 5; k++) {
        events.peak_count2 = squares[k][0];
        assert_int_equal(message(BT_EVENT_KIND_JOLT).peak_count, squares[k][1]);
    }
    assert_int_equal(message(BT_EVENT_KIND_STUCK).peak_count, BT_INVALID_COUNT);
    bt_msg_event touch = message(BT_EVENT_KIND_TOUCH), lift = message(BT_EVENT_KIND_LIFT);
    assert_true(touch.energy_count2 == 77 && lift.energy_count2 == 77);
    assert_true(touch.onset_us == 5000000 && touch.peak_count == BT_INVALID_COUNT);
}

int main(void)
{
    return run_all(NULL, held);
}
