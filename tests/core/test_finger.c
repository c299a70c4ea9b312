// One finger from slots to messages: assembly, validity, flags, sequence numbers.
#include "support.h"

#include "finger.h"
#include "signal/signals.h"

static bt_finger finger;
static bt_solve_settings settings;
static bt_tare_settings tare_settings;
static bt_msg_frame frame;
static bt_msg_pac pac;
static bt_msg_tare tare;
static bool tare_changed;
static uint32_t now_us;

static int new_finger(void **state)
{
    (void)state;
    bt_settings all;
    bt_settings_reset(&all);
    settings = bt_solve_settings_from(&all);
    tare_settings = bt_tare_settings_from(&all);
    bt_finger_reset(&finger, 3);
    now_us = 1000;
    return 0;
}

// PAC PDC PAC TAC PAC TDC PAC E1 PAC E2 ... PAC E19, typed here and not taken from the generated table.
enum { PDC_SLOT = 1, TAC_SLOT = 3, TDC_SLOT = 5, E1_SLOT = 7 };

static int electrode_slot(int index)
{
    return E1_SLOT + 2 * index;
}

// Every slot has its own count, so that a word in a wrong place shows.
static uint16_t slot_count(int slot)
{
    return (uint16_t)(2000 + 10 * slot);
}

// What the session does at the end of a round, with everything subscribed to.
static bool finish(void)
{
    if (!bt_finger_end(&finger, &tare_settings)) {
        tare_changed = false;
        return false;
    }
    tare_changed = finger.tare_unsent;
    bt_finger_tare(&finger, &tare);
    bt_finger_frame(&finger, &settings, finger.quantities, 0, &frame);
    bt_finger_pac(&finger, &pac);
    return true;
}

// One round; missing is a bit mask of slots without a good word. Returns what finish says.
static bool round_without(uint64_t missing)
{
    bt_finger_begin(&finger, now_us, &tare_settings);
    now_us += 10000;
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        (void)bt_finger_put(&finger, slot, missing >> slot & 1 ? BT_INVALID_COUNT : slot_count(slot));
    }
    memset(&frame, 0xA5, sizeof frame);
    memset(&pac, 0xA5, sizeof pac);
    return finish();
}

static void rounds(int n)
{
    for (int k = 0; k < n; k++) {
        assert_true(round_without(0));
    }
}

TEST(every_slot_lands_in_its_place)
{
    assert_true(round_without(0));
    for (int i = 0; i < BT_ELECTRODES; i++) {
        assert_int_equal(frame.counts[i], slot_count(electrode_slot(i)));
    }
    assert_int_equal(frame.pdc, slot_count(PDC_SLOT));
    assert_int_equal(frame.tac, slot_count(TAC_SLOT));
    assert_int_equal(frame.tdc, slot_count(TDC_SLOT));
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        assert_int_equal(pac.pac[k], slot_count(2 * k));
    }
    assert_true(frame.finger == 3 && pac.finger == 3);
    assert_int_equal(frame.t_us, 1000);
    assert_int_equal(pac.t_us, 1000); // PAC comes first
}

TEST(a_missing_slot_is_marked_and_never_stale)
{
    rounds(20);
    for (int slot = 0; slot < BT_SLOTS; slot++) {
        assert_true(round_without((uint64_t)1 << slot));
        uint32_t want = BT_FRAME_FLAG_POC_LOW | BT_FRAME_FLAG_POC_INVALID | BT_FRAME_FLAG_POPULATION
                        | BT_FRAME_FLAG_OUTSIDE | BT_FRAME_FLAG_TARE_UNSURE;
        if (slot % 2 == 0) {
            assert_int_equal(pac.pac[slot / 2], BT_INVALID_COUNT);
        } else if (slot >= E1_SLOT) {
            want |= BT_FRAME_FLAG_ELECTRODE_MISSING | BT_FRAME_FLAG_ELECTRODE_OUT;
            assert_int_equal(frame.electrodes_out, 1u << (slot - E1_SLOT) / 2);
            assert_int_equal(frame.counts[(slot - E1_SLOT) / 2], BT_INVALID_COUNT);
        } else {
            static const uint32_t flags[] = {BT_FRAME_FLAG_PDC_MISSING, BT_FRAME_FLAG_TAC_MISSING,
                                             BT_FRAME_FLAG_TDC_MISSING};
            const uint16_t values[] = {frame.pdc, frame.tac, frame.tdc};
            want |= flags[slot / 2];
            assert_int_equal(values[slot / 2], BT_INVALID_COUNT);
        }
        assert_int_equal(frame.flags, want);
        int invalid = 0;
        for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
            invalid += pac.pac[k] == BT_INVALID_COUNT;
        }
        for (int i = 0; i < BT_ELECTRODES; i++) {
            invalid += frame.counts[i] == BT_INVALID_COUNT;
        }
        invalid += (frame.pdc == BT_INVALID_COUNT) + (frame.tac == BT_INVALID_COUNT);
        assert_int_equal(invalid + (frame.tdc == BT_INVALID_COUNT), 1);
    }
}

TEST(slots_that_never_came_are_missing_too)
{
    rounds(1);
    bt_finger_begin(&finger, now_us, &tare_settings);
    (void)bt_finger_put(&finger, 42, 5); // the main loop was late for all others
    assert_true(finish());
    for (int i = 0; i < BT_ELECTRODES; i++) {
        assert_int_equal(frame.counts[i], BT_INVALID_COUNT);
    }
    assert_int_equal(pac.pac[21], 5);
    assert_int_equal(pac.pac[20], BT_INVALID_COUNT);
    assert_true(frame.flags & BT_FRAME_FLAG_FAULT);
}

TEST(an_absent_sensor_sends_nothing_and_counts_nothing)
{
    rounds(3);
    assert_int_equal(frame.seq, 2);
    for (int k = 0; k < 100; k++) {
        assert_false(round_without(UINT64_MAX));
        assert_false(tare_changed);
        assert_false(finger.present);
        assert_int_equal(frame.seq, 0xA5A5); // left alone
    }
    rounds(1);
    assert_int_equal(frame.seq, 3);
    assert_true(finger.present);
}

TEST(a_sensor_that_was_away_keeps_its_tare_until_it_is_told_to_be_another)
{
    rounds(20);
    assert_int_equal(frame.tare_state, BT_TARE_STATE_REST);
    for (int away = 1; away <= 1000; away *= 10) {
        for (int k = 0; k < away; k++) {
            (void)round_without(UINT64_MAX);
        }
        rounds(1);
        assert_int_equal(frame.tare_state, BT_TARE_STATE_REST);
        assert_false(frame.flags & BT_FRAME_FLAG_UNTARED);
    }
    bt_finger_forget(&finger);
    rounds(1);
    assert_int_equal(frame.tare_state, BT_TARE_STATE_INIT);
    assert_true(frame.flags & BT_FRAME_FLAG_UNTARED);
}

TEST(results_without_a_tare_are_invalid_and_not_zero)
{
    rounds(1);
    assert_int_equal(frame.flags, BT_FRAME_FLAG_UNTARED | BT_FRAME_FLAG_POC_INVALID);
    assert_int_equal(frame.tare_state, BT_TARE_STATE_INIT);
    assert_int_equal(frame.pdc_tare_q4, BT_INVALID_COUNT);
    for (int d = 0; d < 3; d++) {
        assert_int_equal(frame.poc_um[d], BT_INVALID_I16);
        assert_int_equal(frame.force_100un[d], BT_INVALID_I32);
        assert_int_equal(frame.torque_mnmm[d], BT_INVALID_I32);
    }
}

TEST(a_new_tare_is_told_once_with_the_frame_that_first_uses_it)
{
    int messages = 0;
    for (int k = 0; k < 50; k++) {
        rounds(1);
        assert_int_equal((frame.flags & BT_FRAME_FLAG_TARE_CHANGED) != 0, tare_changed);
        if (!tare_changed) {
            continue;
        }
        messages++;
        assert_int_equal(tare.seq, frame.seq);
        assert_int_equal(tare.t_us, frame.t_us);
        assert_int_equal(tare.finger, 3);
        assert_int_equal(tare.tare_state, BT_TARE_STATE_REST);
        assert_int_equal(tare.reason, BT_TARE_REASON_START);
        assert_int_equal(tare.pdc_tare_q16, slot_count(PDC_SLOT) << 16);
        assert_int_equal(frame.pdc_tare_q4, slot_count(PDC_SLOT) << 4);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            assert_int_equal(tare.tare_q16[i], slot_count(electrode_slot(i)) << 16);
            assert_int_equal(frame.tare_q4[i], slot_count(electrode_slot(i)) << 4);
        }
    }
    assert_int_equal(messages, 1);
}

TEST(a_tare_set_by_the_host_is_used_and_told_from_the_next_frame_on)
{
    settings.population = false;
    bt_baseline base = {.pdc_q16 = BT_TARE_UNKNOWN};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = (uint32_t)(slot_count(electrode_slot(i)) * 16 + 5)
                                << 12; // 5/16 over the counts
    }
    rounds(20);
    assert_int_equal(bt_tare_set(&finger.tare, &base, 0), BT_ERROR_OK);
    assert_false(round_without(UINT64_MAX)); // a silent round is no next frame
    rounds(1);
    assert_true(tare_changed);
    assert_int_equal(tare.reason, BT_TARE_REASON_HOST_SET);
    assert_int_equal(tare.seq, frame.seq);
    assert_true(frame.flags & BT_FRAME_FLAG_TARE_CHANGED);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        assert_int_equal(frame.tare_q4[i], slot_count(electrode_slot(i)) * 16 + 5);
    }
    // 12.116 * 5/16 counts * 2.262234 mN: Lin's sum of all normals at a compression of 5/16.
    assert_int_equal(frame.force_100un[2], 86);
    rounds(1);
    assert_false(tare_changed);
}

TEST(a_railed_electrode_is_flagged_and_three_are_a_fault)
{
    rounds(20);
    for (int railed = 0; railed <= 4; railed++) {
        bt_finger_begin(&finger, now_us, &tare_settings);
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            bool at_rail = slot >= E1_SLOT && slot < electrode_slot(railed) && slot % 2 == 1;
            (void)bt_finger_put(&finger, slot, at_rail ? 4095 : slot_count(slot));
        }
        assert_true(finish());
        assert_int_equal((frame.flags & BT_FRAME_FLAG_RAIL) != 0, railed > 0);
        assert_int_equal((frame.flags & BT_FRAME_FLAG_FAULT) != 0, railed > 2);
        assert_int_equal(frame.tare_state == BT_TARE_STATE_FAULT, railed > 2);
        assert_int_equal(frame.counts[0], railed > 0 ? 4095 : slot_count(E1_SLOT)); // reported as read
    }
}

TEST(a_held_press_is_flagged_by_its_shape_and_age)
{
    rounds(200);
    for (int k = 0; k < 6200; k++) {
        bt_finger_begin(&finger, now_us, &tare_settings);
        now_us += 10000;
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            bool pad = slot == electrode_slot(16) || slot == electrode_slot(1)      // E17, E2
                       || slot == electrode_slot(11) || slot == electrode_slot(17); // E12, E18
            int drop = pad ? 200 : slot == PDC_SLOT ? -100 : 0;
            (void)bt_finger_put(&finger, slot, (uint16_t)(slot_count(slot) - drop));
        }
        assert_true(finish());
        bool touched = frame.tare_state == BT_TARE_STATE_CONTACT;
        assert_int_equal((frame.flags & BT_FRAME_FLAG_CONTACT) != 0, touched);
        assert_true(touched || k < 5);
        assert_true(frame.flags & BT_FRAME_FLAG_TORSION_OK); // on the pad, four electrodes, strong
        assert_false(frame.flags
                     & (BT_FRAME_FLAG_POC_LOW | BT_FRAME_FLAG_SHEAR_MIX | BT_FRAME_FLAG_POC_INVALID));
        assert_int_equal((frame.flags & BT_FRAME_FLAG_BASE_OLD) != 0, finger.tare.contact_rounds > 6000);
    }
    assert_true(frame.flags & BT_FRAME_FLAG_BASE_OLD);
}

TEST(seq_wraps_like_any_other_number)
{
    for (uint32_t k = 0; k < 65536 + 10; k++) {
        rounds(1);
        assert_int_equal(frame.seq, k & 0xFFFF);
        assert_int_equal(pac.seq, frame.seq);
    }
}

TEST(an_electrode_without_a_tare_is_no_signal)
{
    uint16_t counts[BT_ELECTRODES], tare_q4[BT_ELECTRODES];
    int32_t e_q4[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        counts[i] = i == 5 ? BT_INVALID_COUNT : 3000;
        tare_q4[i] = i == 4 ? BT_INVALID_COUNT : 3001 * 16;
    }
    bt_signals_q4(counts, tare_q4, e_q4);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        assert_int_equal(e_q4[i], i == 4 || i == 5 ? 0 : -16);
    }
}

// The host may store a tare before the sensor has said a word.
TEST(a_tare_set_before_the_sensor_answers_is_kept)
{
    bt_baseline base;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = (uint32_t)(slot_count(electrode_slot(i)) - 1) << 16;
    }
    base.pdc_q16 = BT_TARE_UNKNOWN;
    assert_int_equal(bt_tare_set(&finger.tare, &base, 0), BT_ERROR_OK);
    for (int k = 0; k < 60; k++) {
        assert_false(round_without(~0ull));
    }
    assert_true(round_without(0));
    assert_int_equal(finger.tare.reason, BT_TARE_REASON_HOST_SET);
    assert_true(tare_changed);
}

TEST(a_touch_that_shows_in_a_lost_slot_is_told_in_the_next)
{
    rounds(50);
    for (int k = 2; k < BT_ELECTRODES; k++) {
        int lost = electrode_slot(k);
        bt_finger copy = finger;
        for (int round = 0; round < 2; round++) { // 19 counts off: with the third, 1083 count^2
            bt_finger_begin(&copy, now_us, &tare_settings);
            for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
                bool off =
                    slot == lost || (round == 1 && (slot == electrode_slot(0) || slot == electrode_slot(1)));
                if (round == 0 || slot != lost) {
                    bool touched = bt_finger_put(&copy, slot, (uint16_t)(slot_count(slot) + (off ? 19 : 0)));
                    assert_int_equal(touched, round == 1 && slot == lost + 1);
                }
            }
            assert_true(bt_finger_end(&copy, &tare_settings)); // for E19, lost last, the FRAME tells
            assert_int_equal(bt_trigger_energy(&copy.tare.trigger), (round == 0 ? 1 : 3) * 19 * 19);
        }
    }
}

TEST(a_move_of_any_electrode_alone_is_one)
{
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            bt_finger moved;
            bt_finger_reset(&moved, 0);
            memset(&moved.sent, 0, sizeof moved.sent);
            memset(&moved.tare.trigger.smooth, 0, sizeof moved.tare.trigger.smooth);
            moved.tare.threshold_count2 = 1000;
            moved.sent.lane[i] = 2000;
            moved.tare.trigger.smooth.lane[i] = (uint16_t)(2000 + sign * 31);
            assert_false(bt_finger_moved(&moved)); // 961
            moved.tare.trigger.smooth.lane[i] = (uint16_t)(2000 + sign * 32);
            assert_true(bt_finger_moved(&moved)); // 1024
        }
    }
}

// A finger whose electrodes stand at 3000, and were tared there.
static void tared_at_3000(bt_round *round, bt_tare *tare, uint32_t threshold_count2)
{
    bt_tare_reset(tare);
    memset(round, 0, sizeof *round);
    tare->tared = true;
    tare->trigger.unknown = 0;
    tare->threshold_count2 = threshold_count2;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        round->electrode[i] = 3000;
        tare->electrode_q4[i] = 16 * 3000;
    }
}

// Of a finger with these signals on E2, E12, E17 and E18, on its pad, and none on all others.
static bool torsion_ok(const int pad_q4[4], uint32_t threshold_count2, uint32_t without)
{
    static const int pad[4] = {1, 11, 16, 17};
    bt_settings all;
    bt_settings_reset(&all);
    (void)bt_settings_set(&all, BT_SETTING_FORCE_MODEL, BT_FORCE_MODEL_LIN);
    const bt_solve_settings settings = bt_solve_settings_from(&all);
    bt_round round;
    bt_tare tare;
    bt_msg_frame msg;
    tared_at_3000(&round, &tare, threshold_count2);
    tare.trigger.without = without;
    for (int k = 0; k < 4; k++) {
        tare.electrode_q4[pad[k]] = (uint16_t)(16 * 3000 - pad_q4[k]);
    }
    bt_results(&round, &tare, &settings, 0, &msg);
    assert_false(msg.flags & BT_FRAME_FLAG_TORSION_OK); // without a point nobody knows
    bt_results(&round, &tare, &settings, BT_QUANTITY_FLAG_POC, &msg);
    return msg.flags & BT_FRAME_FLAG_TORSION_OK;
}

// A finger with these signals on its first electrodes; the last one was never read, or was.
static uint32_t shape_flags(const int e_q4[7], bool unread, uint32_t threshold_count2)
{
    bt_round round;
    bt_tare tare;
    bt_msg_frame msg;
    tared_at_3000(&round, &tare, threshold_count2);
    if (unread) {
        tare.trigger.unknown = 1u << (BT_ELECTRODES - 1);
        round.electrode[BT_ELECTRODES - 1] = BT_INVALID_COUNT;
    }
    for (int i = 0; i < 7; i++) {
        tare.electrode_q4[i] = (uint16_t)(16 * 3000 - e_q4[i]);
    }
    bt_results(&round, &tare, &settings, BT_QUANTITY_FLAG_POC, &msg);
    return msg.flags & (BT_FRAME_FLAG_POC_LOW | BT_FRAME_FLAG_SHEAR_MIX);
}

// Of energies in 1/4 count^2, cut to whole ones.
TEST(more_than_half_as_bulge_is_shear_and_below_four_thresholds_a_point_is_noise)
{
    for (int missing = 0; missing <= 1; missing++) {
        // 21^2 three times is 1323, 330 whole; 36^2 + 4^2 + 2^2 + 1 is 1317, of all 660.
        const int half[7] = {168, 168, 168, -288, -32, -16, -8}, more[7] = {168, 168, 168, -288, -16, 0, 0};
        assert_int_equal(shape_flags(half, missing, 165), 0);
        assert_int_equal(shape_flags(half, missing, 166), BT_FRAME_FLAG_POC_LOW);
        assert_int_equal(shape_flags(more, missing, 0), BT_FRAME_FLAG_SHEAR_MIX);
        const int even[7] = {160, -160}, bulge[7] = {161, -160}, above[7] = {168, -160};
        assert_int_equal(shape_flags(even, missing, 0), 0);
        assert_int_equal(shape_flags(bulge, missing, 0), 0); // cut to half a count
        assert_int_equal(shape_flags(above, missing, 0), BT_FRAME_FLAG_SHEAR_MIX);
    }
}

TEST(torsion_takes_four_electrodes_that_moved_fifteen_counts_and_a_touch)
{
    assert_true(torsion_ok((const int[4]){-240, -240, -240, -240}, 899, 0));  // an energy of 900
    assert_false(torsion_ok((const int[4]){-240, -240, -240, -240}, 899, 1)); // E1 is estimated
    assert_false(torsion_ok((const int[4]){-240, -240, -240, -240}, 900, 0));
    assert_false(torsion_ok((const int[4]){-240, -240, -240, -239}, 0, 0));
    assert_true(torsion_ok((const int[4]){-400, -400, -400, 240}, 0, 0));
    assert_false(torsion_ok((const int[4]){-400, -400, -400, 239}, 0, 0));
    assert_false(torsion_ok((const int[4]){-900, -900, -900, 0}, 0, 0));
}

int main(void)
{
    return run_all(NULL, new_finger);
}
