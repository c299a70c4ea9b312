// The evidence of events by hand: one stretch of samples at a time, at the edges of every limit.
#include "../emulated_finger.h"

#include "events/events.h"

#define LEVEL         800
#define BEGIN         1200                    // the least level until a slip is on
#define TOLL          (3 * (BEGIN * 11 / 16)) // that noise takes of each side in a stretch of three pairs
#define RAISED(event) (1u << BT_EVENT_KIND_##event)

static bt_tare tare;
static uint16_t pac[BT_PAC_PER_FRAME];
static bt_events events;

BEFORE_EACH(held)
{
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
    events.pair = 4000;
    for (int k = 0; k < BT_EVENTS_APART; k++) {
        events.four[k] = 8000;
    }
}

// The second stretch of a round, three pairs that do not change anything; returns the events told.
static uint32_t stretch(void)
{
    events.pairs_done = 4;
    return bt_events_pac(&events, &tare, pac, 15);
}

// The same with this much evidence left after it.
static uint32_t shaken(uint32_t risen_count2, uint32_t fallen_count2)
{
    events.risen_count2 = risen_count2 + TOLL;
    events.fallen_count2 = fallen_count2 + (fallen_count2 > 0 ? TOLL : 0);
    uint32_t flagged = stretch();
    assert_int_equal(events.risen_count2, risen_count2);
    assert_int_equal(events.fallen_count2, fallen_count2);
    return flagged;
}

TEST(a_slip_goes_both_ways_by_more_than_seventeen_levels)
{
    static const struct {
        uint32_t risen, fallen, flagged;
    } cases[] = {{20400, 20401, 0}, {20401, 20400, 0}, {20401, 20401, RAISED(SLIP)}};
    for (int k = 0; k < 3; k++) {
        held();
        events.jolt_raised = true;
        assert_int_equal(shaken(cases[k].risen, cases[k].fallen), cases[k].flagged);
        assert_int_equal(events.slipping, cases[k].flagged != 0);
        held();
        events.touched = false;
        tare.state = BT_TARE_STATE_REST;
        assert_int_equal(shaken(cases[k].risen, cases[k].fallen), RAISED(JOLT)); // no slip without a touch
    }
}

TEST(a_jolt_is_more_than_22_levels_and_told_once)
{
    assert_int_equal(shaken(17600, 0), 0);
    assert_int_equal(shaken(8800, 8800), 0);
    assert_int_equal(shaken(17601, 0), RAISED(JOLT));
    assert_int_equal(shaken(20000, 0), 0);
    assert_int_equal(shaken(1, 0), 0);
    events.risen_count2 = TOLL;
    events.fallen_count2 = 0;
    assert_int_equal(stretch(), 0); // over: the next one is another
    assert_int_equal(shaken(17601, 0), RAISED(JOLT));
}

// Sums of two samples: 4000, 4200, 3600. The changes are 0, 200 and -200, of at most twelve levels each.
static void swing(void)
{
    static const uint16_t words[6] = {2000, 2000, 2100, 2100, 1800, 1800};
    memcpy(pac + 8, words, sizeof words);
    events.jolt_raised = true; // of before
}

TEST(a_side_begins_at_the_first_pair_that_moved_its_way)
{
    swing();
    assert_int_equal(stretch(), 0);
    assert_true(events.risen_count2 == 12 * BEGIN - TOLL && events.fallen_count2 == 12 * BEGIN - TOLL);
    assert_int_equal(events.rise_began, 100000 + 2);
    assert_int_equal(events.fall_began, 100000 + 4);
    assert_int_equal(events.shake_began, 100000 + 2);
    assert_int_equal(events.peak_count2, 40000);
    held();
    swing();
    pac[8] = BT_INVALID_COUNT; // and whatever it would be part of
    assert_int_equal(stretch(), 0);
    assert_int_equal(events.risen_count2, 0);
    assert_int_equal(events.fall_began, 100000 + 4);
    assert_int_equal(events.shake_began, 100000 + 4);
}

TEST(while_it_slips_both_sides_are_one)
{
    events.slipping = events.jolt_raised = true;
    events.risen_count2 = 24000;
    events.fallen_count2 = 7000;
    swing();
    assert_int_equal(stretch(), 0);
    assert_int_equal(events.risen_count2, 31000 + 2 * 12 * LEVEL - 3 * LEVEL);
    assert_int_equal(events.fallen_count2, 0);
    assert_int_equal(events.round_count2, 2 * 12 * LEVEL);
    assert_int_equal(events.shaken_count2, 80000);
    for (uint32_t over = 0; over < 2; over++) {
        held();
        events.slipping = events.jolt_raised = true;
        events.risen_count2 = 100 * LEVEL + 3 * LEVEL + over;
        (void)stretch();
        assert_int_equal(events.risen_count2, 100 * LEVEL);
    }
    events.risen_count2 = 3 * LEVEL + 1;
    assert_int_equal(stretch(), 0);
    assert_true(events.slipping);
    events.risen_count2 = 3 * LEVEL;
    assert_int_equal(stretch(), RAISED(STUCK));
    assert_false(events.slipping || events.jolt_raised);
    assert_int_equal(stretch(), 0);
}

// The level is the shaking of the round, per sample, beyond eleven times the explained part.
TEST(a_level_is_told_of_rounds_that_slip)
{
    static const struct {
        uint32_t shaken_count2;
        uint8_t level;
    } cases[] = {{11 * LEVEL, 0},
                 {11 * LEVEL + 12 * 12, 0},
                 {11 * LEVEL + 13 * 13, 1},
                 {11 * LEVEL + 164 * 164, 12},
                 {11 * LEVEL + 3251 * 3251, 253},
                 {UINT32_MAX - 4000000, 254}};
    assert_int_equal(events.slip_level, BT_SLIP_LEVEL_NONE);
    for (int k = 0; k < 12; k++) {
        held();
        events.slipping = k < 6;
        events.risen_count2 = 90 * LEVEL; // nor does it end
        events.jolt_raised = events.landing = true;
        events.shaken_count2 = cases[k % 6].shaken_count2;
        events.pairs_done = 7;
        assert_int_equal(bt_events_pac(&events, &tare, pac, BT_PAC_PER_FRAME), 0);
        assert_int_equal(events.slip_level, k < 6 ? cases[k].level : 0);
        assert_int_equal(events.shaken_count2, 0);
    }
}

// Neighbours that differ by 40 for long: white noise of sigma 28, with a mean square change of 6400.
TEST(what_rattles_must_shake_more)
{
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        pac[k] = (uint16_t)(2000 + (k & 1 ? 20 : -20));
    }
    (void)stretch();
    assert_int_equal(events.rattle_count2, 3 * 40 * 40 / 32);
    for (int k = 0; k < 200; k++) {
        assert_int_equal(stretch(), 0);
    }
    assert_in_range(events.rattle_count2, 1580, 1600);
    const uint32_t unit = 7 * events.rattle_count2, toll = 3 * (unit * 11 / 16);
    for (uint32_t more = 0; more < 2; more++) {
        events.jolt_raised = true;
        events.risen_count2 = events.fallen_count2 = 17 * unit + toll + more;
        assert_int_equal(stretch(), more ? RAISED(SLIP) : 0);
    }
}

// A finger lands for a tenth of a second after a touch, and while it shakes, for up to a second.
TEST(what_has_just_been_touched_lands)
{
    for (uint32_t since = 219; since <= 220; since++) {
        held();
        events.landing = true;
        events.touch_began = events.now + 6 - since;
        (void)stretch(); // does not shake
        assert_int_equal(events.landing, since < 220);
    }
    for (uint32_t since = 2199; since <= 2200; since++) {
        held();
        events.landing = true;
        events.touch_began = events.now + 6 - since;
        assert_int_equal(shaken(20401, 20401), since < 2200 ? RAISED(JOLT) : RAISED(JOLT) | RAISED(SLIP));
        assert_int_equal(events.landing, since < 2200);
    }
}

// Rise and fall within 18 samples are one vibration, which began with the earlier; else with the later.
TEST(a_slip_began_with_its_vibration)
{
    static const struct {
        int32_t fall_after_rise;
        bool with_rise;
    } cases[] = {{18, true}, {19, false}, {1, true}, {-1, false}, {-18, false}, {-19, true}};
    for (int k = 0; k < 6; k++) {
        held();
        events.jolt_raised = true;
        events.rise_began = 99000;
        events.fall_began = 99000 + (uint32_t)cases[k].fall_after_rise;
        assert_int_equal(shaken(20401, 20401), RAISED(SLIP));
        assert_int_equal(events.slip_began, cases[k].with_rise ? events.rise_began : events.fall_began);
    }
}

// 825 a pair, all three together: two changes of 35 are below it, two of 36 above.
TEST(noise_is_eleven_sixteenths_of_a_level)
{
    for (uint16_t change = 35; change <= 36; change++) {
        held();
        pac[10] = (uint16_t)(2000 + change);
        events.peak_count2 = 1000000; // of the shaking before
        (void)stretch();
        const uint32_t both = 2u * change * change;
        assert_int_equal(events.shaken_count2, both);
        assert_int_equal(events.risen_count2, both > TOLL ? both - TOLL : 0);
        assert_int_equal(events.peak_count2, both > TOLL ? change * change : 1000000);
    }
    assert_int_equal(events.shake_began, 100000 + 2);
}

// Two changes' share of a round's noise, as a mean over many rounds at rest, within limits.
TEST(the_level_is_the_noise_at_rest)
{
    enum { AT_REST, TOUCHED, UNTARED, STATES };
    static const struct {
        uint32_t round_count2, level_count2;
    } cases[] = {{1100, LEVEL}, {11000, 2000}, {10000000, (1 << 20) * 2 / 11}};
    for (int k = 0; k < 3 * STATES; k++) {
        held();
        tare.state = k % STATES == UNTARED ? BT_TARE_STATE_INIT : BT_TARE_STATE_REST;
        events.touched = k % STATES == TOUCHED;
        for (int rounds = 0; rounds < 1000; rounds++) {
            events.round_count2 = cases[k / STATES].round_count2;
            events.pairs_done = 7;
            (void)bt_events_pac(&events, &tare, pac, BT_PAC_PER_FRAME);
            assert_true(events.round_count2 == 0 && events.pairs_done == 0);
        }
        const uint32_t level = k % STATES == AT_REST ? cases[k / STATES].level_count2 : LEVEL;
        assert_in_range(events.level_count2, level - level / 100, level + level / 100);
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
    static const uint32_t squares[][2] = {{0, 0}, {16, 1}, {6399, 19}, {6400, 20}, {16380 * 16380, 4095}};
    for (int k = 0; k < 5; k++) {
        events.peak_count2 = squares[k][0];
        assert_int_equal(message(BT_EVENT_KIND_JOLT).peak_count, squares[k][1]);
    }
    assert_int_equal(message(BT_EVENT_KIND_STUCK).peak_count, BT_INVALID_COUNT);
    bt_msg_event touch = message(BT_EVENT_KIND_TOUCH), lift = message(BT_EVENT_KIND_LIFT);
    assert_true(touch.energy_count2 == 77 && lift.energy_count2 == 77);
    assert_true(touch.onset_us == 5000000 && touch.peak_count == BT_INVALID_COUNT);
}
