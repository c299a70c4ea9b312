// The trigger, word by word: what it holds back, what it lets through and in which slot, and that its energy
// is the sum that it claims to be.
#include "emulated_finger.h"

#define LIMIT 1000

// The trigger's filter as a story: a word is believed when it is near rest, which the first one was, or when
// the round before had one that was not near either.
typedef struct {
    int rest; // 0: none yet
    int believed;
    bool far_before;
} lane_story;

static bool good(uint16_t word)
{
    return word >= 1 && word <= 4089;
}

static int told(lane_story *story, uint16_t word)
{
    if (good(word) && story->rest == 0) {
        story->rest = word;
    }
    bool far = good(word) && abs(word - story->rest) > 24;
    if (good(word) && (!far || story->far_before)) {
        story->believed = word;
    }
    story->far_before = far;
    return story->believed;
}

// A trigger whose electrodes have all read their rest once.
static bt_trigger rested_trigger(const uint16_t rest[BT_ELECTRODES])
{
    bt_trigger trigger;
    bt_trigger_reset(&trigger);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        (void)bt_trigger_electrode(&trigger, i, rest[i]);
    }
    assert_int_equal(bt_trigger_energy(&trigger), 0);
    return trigger;
}

static uint32_t round_energy(bt_trigger *trigger, int32_t limit, const uint16_t word[BT_ELECTRODES])
{
    bt_trigger_begin(trigger, limit);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        (void)bt_trigger_electrode(trigger, i, word[i]);
    }
    return bt_trigger_energy(trigger);
}

// ---- glitches --------------------------------------------------------------------------------------

TEST(lone_glitches_of_any_size_reach_neither_energy_nor_means)
{
    uint16_t rest[BT_ELECTRODES], word[BT_ELECTRODES];
    bt_sweep sweep;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        rest[i] = i % 2 ? 4045 : 45; // each can glitch by 4000
    }
    bt_trigger trigger = rested_trigger(rest);
    bt_sweep_restart(&sweep);
    for (int round = 0; round < 2 * 3976; round++) {
        memcpy(word, rest, sizeof word);
        int glitching = round / 2 * 7 % BT_ELECTRODES;
        int size = round % 2 ? 0 : 25 + round / 2;
        word[glitching] = (uint16_t)(rest[glitching] + (glitching % 2 ? -size : size));
        assert_int_equal(round_energy(&trigger, LIMIT, word), 0);
        bt_sweep_add(&sweep, &trigger.smooth);
        for (unsigned i = bt_sweep_first(&sweep); i < bt_sweep_end(&sweep) && i < BT_ELECTRODES; i++) {
            assert_int_equal(bt_sweep_close(&sweep, i, 96), 8 * rest[i]);
        }
        (void)bt_sweep_next(&sweep);
    }
    // One count less is a word like any other.
    word[3] = (uint16_t)(rest[3] - 24);
    assert_int_equal(round_energy(&trigger, LIMIT, word), 24 * 24);
}

TEST(a_jump_and_a_gap_are_forgotten)
{
    static const uint16_t gaps[] = {BT_INVALID_COUNT, 0, 4090, 4095};
    emulated_finger resting = resting_finger();
    for (int k = 0; k < 4; k++) {
        emulated_finger finger = resting;
        const uint16_t course[] = {2000, gaps[k], 2000, gaps[k], 2000, 2000};
        for (int round = 0; round < 6; round++) {
            bt_round frame = frame_without(&finger, 4, 1, course[round]);
            assert_int_equal(feed(&finger, &frame), round == 5 ? 4 : -1);
            assert_true(round == 5 || bt_trigger_energy(&finger.tare.trigger) == 0);
        }
        // The same with pressure.
        finger = resting;
        for (int round = 0; round < 6; round++) {
            bt_round frame = next_frame(&finger);
            frame.pdc = course[round];
            assert_int_equal(feed(&finger, &frame), round == 5 ? BT_LANE_PDC : -1);
        }
    }
}

// ---- touches ---------------------------------------------------------------------------------------

TEST(the_slot_told_is_that_in_which_the_sum_passes_the_threshold)
{
    uint64_t seed = 42;
    int seen[BT_ELECTRODES + 1] = {0};
    emulated_finger resting = resting_finger();
    for (int trial = 0; trial < 2000; trial++) {
        emulated_finger finger = resting;
        bt_round frame = next_frame(&finger);
        int size = (int)random_range(&seed, 4, 40);
        int expected[2] = {-1, -1};
        uint32_t sum[2] = {0, 0};
        for (int i = 0; i < BT_ELECTRODES; i++) {
            int change = (int)random_range(&seed, -size, size);
            frame.electrode[i] = (uint16_t)(frame.electrode[i] + change);
            for (int word = 0; word < 2; word++) {
                sum[word] += word == 0 && abs(change) > 24 ? 0 : (uint32_t)(change * change);
                expected[word] = expected[word] < 0 && sum[word] > SETTING_COUNT2 ? i : expected[word];
            }
        }
        assert_int_equal(feed(&finger, &frame), expected[0]);
        assert_int_equal(bt_trigger_energy(&finger.tare.trigger), sum[0]);
        assert_int_equal(feed(&finger, &frame), expected[0] < 0 ? expected[1] : -1);
        assert_int_equal(bt_trigger_energy(&finger.tare.trigger), sum[1]);
        seen[expected[1] + 1]++;
    }
    for (int i = 0; i <= BT_ELECTRODES; i++) {
        assert_true(i == 1 || i == 2 || seen[i] > 0); // E1 alone cannot, E1 and E2 hardly
    }
}

TEST(pressure_opens_the_gate_and_leaves_the_energy_alone)
{
    emulated_finger resting = resting_finger();
    for (int above = -12; above <= 300; above++) {
        emulated_finger finger = resting;
        finger.pdc_load = above;
        bt_round frame = next_frame(&finger);
        frame.electrode[2] = (uint16_t)(frame.electrode[2] + 20);
        int first = above > 6 && above <= 24 ? BT_LANE_PDC : -1;
        int second = above > 24 ? BT_LANE_PDC : -1;
        assert_int_equal(feed(&finger, &frame), first);
        assert_int_equal(bt_trigger_energy(&finger.tare.trigger), 400);
        assert_int_equal(feed(&finger, &frame), second);
        assert_int_equal(bt_trigger_energy(&finger.tare.trigger), 400);
        assert_int_equal(feed(&finger, &frame), -1);
        assert_int_equal(finger.tare.hits, above <= 6 ? 0 : above <= 24 ? 0 : 2);
        assert_int_equal(finger.tare.state,
                         above > 6 && above <= 24 ? BT_TARE_STATE_CONTACT : BT_TARE_STATE_REST);
    }
}

// What is above by as much as it may be is no touch, nor is what uses up all room; one more of either is.
TEST(the_edges_of_pressure_and_room_are_no_touch)
{
    uint16_t counts[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        counts[i] = 2000;
    }
    for (int room = 0; room <= 1; room++) {
        for (int above = 6; above <= 7; above++) {
            bt_trigger trigger = rested_trigger(counts);
            trigger.rest.lane[BT_LANE_PDC] = trigger.smooth.lane[BT_LANE_PDC] = 1000;
            trigger.unknown = 0;
            bt_trigger_begin(&trigger, 100 + room);
            assert_int_equal(bt_trigger_electrode(&trigger, 3, 2010), room);
            assert_int_equal(bt_trigger_pressure(&trigger, (uint16_t)(1000 + above), 6) < 0, above == 7);
            assert_int_equal(bt_trigger_energy(&trigger), 100);
        }
    }
    for (int off = 24; off <= 25; off++) { // a word that is far is held back
        for (int sign = -1; sign <= 1; sign += 2) {
            bt_trigger trigger = rested_trigger(counts);
            bt_trigger_begin(&trigger, 10000);
            (void)bt_trigger_electrode(&trigger, 3, (uint16_t)(2000 + sign * off));
            assert_int_equal(bt_trigger_energy(&trigger), off == 24 ? 24 * 24 : 0);
        }
    }
}

TEST(pressure_without_a_known_rest_opens_nothing)
{
    emulated_finger finger = resting_finger();
    bt_baseline base = finger.tare.base;
    base.pdc_q16 = BT_TARE_UNKNOWN;
    assert_int_equal(bt_tare_set(&finger.tare, &base, 0), BT_ERROR_OK);
    for (int round = 0; round < 200; round++) {
        finger.pdc_load = 5 * round;
        bt_round frame = next_frame(&finger);
        assert_int_equal(feed(&finger, &frame), -1);
        assert_true(finger.tare.trigger.room >= 0);
    }
    assert_int_equal(finger.tare.state, BT_TARE_STATE_REST);
}

TEST(the_gate_stays_shut_where_nobody_rests)
{
    uint64_t seed = 44;
    emulated_finger init, contact = touched_finger(400, 0), fault = resting_finger();
    finger_init(&init);
    emulated_finger *fingers[] = {&init, &contact, &fault};
    static const uint8_t states[] = {BT_TARE_STATE_INIT, BT_TARE_STATE_CONTACT, BT_TARE_STATE_FAULT};
    bt_round dead = frame_without(&fault, 0, 3, 4095);
    (void)feed(&fault, &dead);
    for (int k = 0; k < 3; k++) {
        for (int round = 0; round < 500; round++) {
            bt_round frame = next_frame(fingers[k]);
            for (int i = k == 2 ? 3 : 0; i < BT_ELECTRODES; i++) {
                frame.electrode[i] = (uint16_t)random_range(&seed, 1, 4089);
            }
            for (int n = 0; k < 2 && n < 2; n++) { // repeated words add what they stand for
                frame.electrode[random_range(&seed, 0, 18)] = BT_INVALID_COUNT;
            }
            for (int i = 0; k == 2 && i < 3; i++) {
                frame.electrode[i] = 4095;
            }
            frame.pdc = (uint16_t)random_range(&seed, PDC_REST, 4089); // less would end the contact
            assert_int_equal(fingers[k]->tare.state, states[k]);
            assert_int_equal(feed(fingers[k], &frame), -1);
            assert_true(fingers[k]->tare.trigger.room >= 0);
        }
    }
}

TEST(an_electrode_that_is_left_out_is_not_used)
{
    uint16_t rest[BT_ELECTRODES], word[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        rest[i] = 2000;
        word[i] = i == 4 ? 1000 : i == 7 ? 1980 : 2000;
    }
    bt_trigger trigger = rested_trigger(rest);
    bt_trigger_leave_out(&trigger, 1u << 4);
    for (int round = 0; round < 3; round++) {
        assert_int_equal(round_energy(&trigger, LIMIT, word), 400); // of E8 alone
        assert_int_equal(trigger.without, 1u << 4);
    }
}

// ---- the energy ------------------------------------------------------------------------------------

TEST(the_energy_is_the_brute_force_sum_of_squares)
{
    static const uint16_t bad[] = {BT_INVALID_COUNT, 0, 4090, 4095};
    uint64_t seed = 45;
    uint16_t rest[BT_ELECTRODES], word[BT_ELECTRODES];
    for (int course = 0; course < 200; course++) {
        lane_story story[BT_ELECTRODES] = {{0, 0, false}};
        int reach = course % 2 ? 5000 : 60;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            rest[i] = (uint16_t)random_range(&seed, 1, 4089);
            word[i] = rest[i];
            (void)told(&story[i], rest[i]);
        }
        bt_trigger trigger = rested_trigger(rest);
        for (int round = 0; round < 100; round++) {
            uint32_t energy = 0;
            uint32_t without = 0;
            for (int i = 0; i < BT_ELECTRODES; i++) {
                int64_t value = random_unit(&seed) < 0.3 && good(word[i])
                                    ? word[i]
                                    : rest[i] + random_range(&seed, -reach, reach);
                word[i] = (uint16_t)(value < 1 ? 1 : value > 4089 ? 4089 : value);
                word[i] = random_unit(&seed) < 0.1 ? bad[random_range(&seed, 0, 3)] : word[i];
                without |= good(word[i]) ? 0 : 1u << i;
                int e = told(&story[i], word[i]) - rest[i];
                energy += (uint32_t)(e * e);
            }
            assert_int_equal(round_energy(&trigger, LIMIT, word), energy);
            assert_int_equal(trigger.room<0, energy> LIMIT);
            assert_int_equal(trigger.without, without);
        }
    }
}

TEST(the_ends_of_the_range_do_not_overflow)
{
    static const int32_t limits[] = {50, 1000, 3 * BT_SETTING_CONTACT_ENERGY_COUNT2_MAX};
    uint16_t low[BT_ELECTRODES], high[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        low[i] = 1;
        high[i] = 4089;
    }
    for (int k = 0; k < 3; k++) {
        for (int up = 0; up < 2; up++) {
            bt_trigger trigger = rested_trigger(up ? low : high);
            bt_trigger_begin(&trigger, limits[k]);
            (void)bt_trigger_pressure(&trigger, 1, 6);
            uint32_t full = 19u * 4088 * 4088;
            assert_int_equal(round_energy(&trigger, limits[k], up ? high : low), 0);
            (void)bt_trigger_pressure(&trigger, 4089, 6);
            assert_int_equal(round_energy(&trigger, limits[k], up ? high : low), full);
            assert_true(trigger.room < 0);
            assert_true(bt_trigger_pressure(&trigger, 4089, 6) < 0);
            assert_int_equal(bt_trigger_energy(&trigger), full);
        }
    }
}

int main(void)
{
    return run_all(NULL, NULL);
}
