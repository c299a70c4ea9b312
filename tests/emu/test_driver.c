// Sampler, word decoder and gateway together: what goes out on the bus and when, and that no finger's
// fault reaches another's data.
#include "rig.h"

// ---- the bus ---------------------------------------------------------------------------------------

// Typed from the product manual's table, not from the generated one.
static const uint8_t wire_command[BT_CHANNELS] = {
    0x80, 0x83, 0x85, 0x86, 0xA2, 0xA4, 0xA7, 0xA8, 0xAB, 0xAD, 0xAE, 0xB0, 0xB3, 0xB5,
    0xB6, 0xB9, 0xBA, 0xBC, 0xBF, 0xC1, 0xC2, 0xC4, 0xC7, 0xC8, 0xCB, 0xCD, 0xCE, 0xD0,
};

static uint32_t commands;
static uint64_t last_slot;
static uint64_t worst_late_ns;

static void check_command(const sent_command *command)
{
    uint32_t slot = commands++ % BT_SLOTS;
    // PAC PDC PAC TAC PAC TDC PAC E1 PAC E2 ... PAC E19; in wire_command PAC PDC TAC TDC E1 E2 ... E19
    uint8_t want = wire_command[slot % 2 == 0 ? 0 : 1 + slot / 2];
    assert_int_equal(command->mosi, want << 8);
    assert_int_equal(command->mask, 0x1F);
}

TEST(all_command_bytes_are_right_on_the_wire)
{
    for (int c = 0; c < BT_CHANNELS; c++) {
        assert_int_equal(bt_channel_command[c], wire_command[c]);
        int parity = 0;
        for (int bit = 0; bit < 8; bit++) {
            parity ^= wire_command[c] >> bit & 1;
        }
        assert_int_equal(parity, 1);
    }
    boot(START_NS);
    commands = 0;
    fake.on_command = check_command;
    run_rounds(200);
    assert_in_range(commands, 200 * BT_SLOTS - 2, 200 * BT_SLOTS + 2);
    assert_int_equal(fake.selected_reads, 0);
}

static void check_time(const sent_command *command)
{
    // Slot n is due n / 4400 s after the first, on a clock of whole us.
    uint64_t due_ns = t0_ns + last_slot * 1000000 / BT_SLOT_HZ * 1000;
    last_slot++;
    assert_true(command->t_ns >= due_ns);
    worst_late_ns = command->t_ns - due_ns > worst_late_ns ? command->t_ns - due_ns : worst_late_ns;
}

TEST(the_slot_rate_is_exact_over_a_minute)
{
    boot(START_NS);
    last_slot = 0;
    worst_late_ns = 0;
    fake.on_command = check_time;
    run_until(t0_ns + 60000000000ull);
    assert_int_equal(worst_late_ns, 0);               // no drift at all
    assert_int_equal(last_slot, 60 * BT_SLOT_HZ + 1); // the last began when the minute was over
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        assert_in_range(host.frames[f], 5999, 6000);
        assert_int_equal(fake.bus.sensor[f].early_reads, 0);
        for (int k = 0; k < host.frames[f]; k++) {
            assert_int_equal(host.frame[f][k].t_us, t0_ns / 1000 + 10000 * (unsigned)k);
            assert_int_equal(host.frame[f][k].seq, k);
            assert_int_equal(host.pac[f][k].t_us, host.frame[f][k].t_us);
        }
    }
    assert_int_equal(gateway.session.status.slots_late, 0);
}

TEST(interrupt_latency_neither_drifts_nor_breaks_the_settling_time)
{
    boot(START_NS);
    last_slot = 0;
    worst_late_ns = 0;
    fake.on_command = check_time;
    fake.latency_ns = 20000;
    run_until(t0_ns + 20000000000ull);
    assert_true(worst_late_ns < 20000);
    assert_in_range(last_slot, 20 * BT_SLOT_HZ, 20 * BT_SLOT_HZ + 1);
    assert_int_equal(gateway.session.status.slots_late, 0);
    assert_true(fake.shortest_gap_ns >= 5000);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        assert_int_equal(fake.bus.sensor[f].early_reads, 0);
    }
}

TEST(the_clock_may_wrap_in_the_middle)
{
    uint64_t wrap_ns = ((uint64_t)1 << 32) * 1000;
    boot(wrap_ns - 1500000000ull);
    run_rounds(300);
    assert_in_range(host.frames[0], 298, 300);
    assert_int_equal(gateway.session.status.slots_late, 0);
    for (int k = 1; k < host.frames[0]; k++) {
        assert_int_equal((uint32_t)(host.frame[0][k].t_us - host.frame[0][k - 1].t_us), 10000);
        assert_false(host.frame[0][k].flags & BT_FRAME_FLAG_ELECTRODE_MISSING);
    }
    assert_true(host.frame[0][0].t_us > host.frame[0][host.frames[0] - 1].t_us);
}

// ---- one finger's fault ------------------------------------------------------------------------------

static bt_msg_frame clean_frame[BT_MAX_FINGERS][MAX_ROUNDS];
static bt_msg_pac clean_pac[BT_MAX_FINGERS][MAX_ROUNDS];
static int clean_frames;

// From the first command on: an absent sensor is not asked for its properties, so sampling begins
// earlier.
static void count_time_from_the_start(void)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        for (int k = 0; k < host.frames[f]; k++) {
            host.frame[f][k].t_us -= (uint32_t)(t0_ns / 1000);
            host.pac[f][k].t_us -= (uint32_t)(t0_ns / 1000);
        }
    }
}

static void fingers_other_than_the_faulty_one_are_untouched(const char *fault_name)
{
    boot(START_NS);
    run_rounds(150);
    count_time_from_the_start();
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (f == trouble.finger) {
            continue;
        }
        assert_int_equal(host.frames[f], clean_frames);
        for (int k = 0; k < host.frames[f]; k++) {
            if (memcmp(&host.frame[f][k], &clean_frame[f][k], sizeof(bt_msg_frame)) != 0
                || memcmp(&host.pac[f][k], &clean_pac[f][k], sizeof(bt_msg_pac)) != 0) {
                fail_msg("%s on finger %d changed frame %d of finger %d", fault_name, trouble.finger, k, f);
            }
        }
    }
}

TEST(one_finger_in_trouble_never_changes_another)
{
    static const struct {
        const char *name;
        uint16_t fault;
        uint32_t period;
    } faults[] = {
        {"bad parity at times", BT_EMU_FAULT_BAD_PARITY, 5},
        {"bad parity", BT_EMU_FAULT_BAD_PARITY, 1},
        {"stuck low", BT_EMU_FAULT_STUCK_LOW, 1},
        {"stuck high", BT_EMU_FAULT_STUCK_HIGH, 1},
        {"error words", BT_EMU_FAULT_TOO_EARLY, 3},
        {"rails", 4095, 1},
        {"unknown channel", BT_EMU_FAULT_NO_CHANNEL, 7},
        {"gone at times", BT_EMU_FAULT_STUCK_LOW, 2},
    };
    boot(START_NS);
    run_rounds(150);
    count_time_from_the_start();
    clean_frames = host.frames[0];
    assert_in_range(clean_frames, 149, 150);
    memcpy(clean_frame, host.frame, sizeof clean_frame);
    memcpy(clean_pac, host.pac, sizeof clean_pac);
    for (uint8_t finger = 0; finger < BT_MAX_FINGERS; finger++) {
        trouble.finger = finger;
        for (size_t k = 0; k < sizeof faults / sizeof *faults; k++) {
            trouble.fault = faults[k].fault;
            trouble.period = faults[k].period;
            fingers_other_than_the_faulty_one_are_untouched(faults[k].name);
        }
        trouble.period = 0;
        trouble.absent = true;
        fingers_other_than_the_faulty_one_are_untouched("absence");
        assert_int_equal(host.frames[finger], 0);
        trouble.absent = false;
    }
}

TEST(every_count_arrives_at_its_finger_and_channel)
{
    boot(START_NS);
    run_rounds(50);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        for (int k = 0; k < host.frames[f]; k++) {
            uint64_t t_ns = first_command_ns + ROUND_NS * (unsigned)k;
            const bt_msg_frame *frame = &host.frame[f][k];
            for (uint8_t i = 0; i < BT_ELECTRODES; i++) {
                assert_int_equal(frame->counts[i], source(NULL, f, (uint8_t)(17 + i), t_ns));
            }
            assert_int_equal(frame->pdc, source(NULL, f, 1, t_ns));
            assert_int_equal(frame->tac, source(NULL, f, 2, t_ns));
            assert_int_equal(frame->tdc, source(NULL, f, 3, t_ns));
            assert_int_equal(host.pac[f][k].pac[21], source(NULL, f, 0, t_ns));
        }
    }
}

TEST(bad_words_are_counted_by_kind_for_their_finger)
{
    trouble.finger = 3;
    trouble.period = 1;
    trouble.fault = BT_EMU_FAULT_NO_CHANNEL;
    boot(START_NS);
    run_rounds(20);
    const bt_finger *finger = gateway.session.finger;
    // In one round of ten it is asked who it is, and not sampled.
    assert_int_equal(finger[3].words.error, 18 * 44);
    assert_int_equal(finger[3].words.good, 0);
    assert_int_equal(finger[3].words.last_error_word, 0xA558);
    assert_int_equal(finger[2].words.error, 0);
    assert_in_range(finger[2].words.good, 20 * 44 - 2, 20 * 44);
}

int main(void)
{
    return run_all(NULL, no_trouble);
}
