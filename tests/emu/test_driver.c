// Sampler, word decoder and gateway together: the commands on the bus, also while the clock wraps.
#include "rig.h"

// Typed from the product manual's table, not from the generated one.
static const uint8_t wire_command[BT_CHANNELS] = {
    0x80, 0x83, 0x85, 0x86, 0xA2, 0xA4, 0xA7, 0xA8, 0xAB, 0xAD, 0xAE, 0xB0, 0xB3, 0xB5,
    0xB6, 0xB9, 0xBA, 0xBC, 0xBF, 0xC1, 0xC2, 0xC4, 0xC7, 0xC8, 0xCB, 0xCD, 0xCE, 0xD0,
};

static uint32_t commands;

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
