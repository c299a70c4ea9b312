// The flags of a FRAME on words, press, point and torsion; the rest of a FRAME:
// test_skips.c, test_lateness.c, test_idle.c.
#include "support.h"

#include "finger.h"

static bt_finger finger;
static bt_solve_settings settings;
static bt_tare_settings tare_settings;
static bt_msg_frame frame;
static bt_msg_pac pac;
static uint32_t now_us;

BEFORE_EACH(new_finger)
{
    bt_settings all;
    bt_settings_reset(&all);
    settings = bt_solve_settings_from(&all);
    tare_settings = bt_tare_settings_from(&all);
    bt_finger_reset(&finger, 3);
    now_us = 1000;
}

// PAC PDC PAC TAC PAC TDC PAC E1 PAC E2 ... PAC E19, typed here and not taken from the generated table.
enum { PDC_SLOT = 1, TAC_SLOT = 3, TDC_SLOT = 5, E1_SLOT = 7 };

static int electrode_slot(int index)
{
    return E1_SLOT + 2 * index;
}

// Every slot has a different count, so that a word in a wrong place shows.
static uint16_t slot_count(int slot)
{
    return (uint16_t)(2000 + 10 * slot);
}

// The session's work at the end of a round.
static void finish(void)
{
    assert_true(bt_finger_end(&finger, &tare_settings));
    bt_finger_frame(&finger, &settings, finger.quantities, 0, &frame);
    bt_finger_pac(&finger, &pac);
}

// One round; missing is a bit mask of slots without a good word.
static void round_without(uint64_t missing)
{
    bt_finger_begin(&finger, now_us, &tare_settings);
    now_us += 10000;
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        (void)bt_finger_put(&finger, slot, missing >> slot & 1 ? BT_INVALID_COUNT : slot_count(slot));
    }
    finish();
}

static void rounds(int n)
{
    for (int k = 0; k < n; k++) {
        round_without(0);
    }
}

TEST(a_missing_slot_is_marked_and_never_stale)
{
    rounds(20);
    for (int slot = 0; slot < BT_SLOTS; slot++) {
        round_without((uint64_t)1 << slot);
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
        finish();
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

// A finger with electrodes at 3000, and tared there.
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

// Of a finger with these signals on E2, E12, E17 and E18, on the pad, and none on all others.
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
    assert_false(msg.flags & BT_FRAME_FLAG_TORSION_OK); // unknown without a point
    bt_results(&round, &tare, &settings, BT_QUANTITY_FLAG_POC, &msg);
    return msg.flags & BT_FRAME_FLAG_TORSION_OK;
}

// A finger with these signals on the first electrodes; the last one was never read, or was.
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

// From energies in 1/4 count^2, cut to whole ones.
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
