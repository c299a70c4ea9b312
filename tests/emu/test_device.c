// The emulated sensor against the data sheet's rules, bit by bit.
#include "support.h"

#include "device.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"
#include "word.h"

static bt_emu_device device;
static uint16_t next_count;
static uint8_t asked_channel;
static int samples;

static uint16_t source(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    (void)t_ns;
    assert_ptr_equal(context, &device);
    assert_int_equal(finger, 2);
    if (channel == BT_EMU_LINE) {
        return next_count > 4095 ? next_count : 0;
    }
    asked_channel = channel;
    samples++;
    return next_count;
}

BEFORE_EACH(new_device)
{
    bt_emu_init(&device, 2, true, "BT0123456789ABCD", source, &device);
    next_count = 2048;
    samples = 0;
}

static uint16_t transfer16(bt_emu_device *device, uint16_t mosi, uint64_t t_ns)
{
    uint8_t high = bt_emu_transfer8(device, (uint8_t)(mosi >> 8), t_ns);
    return (uint16_t)(high << 8 | bt_emu_transfer8(device, (uint8_t)mosi, t_ns));
}

// One transfer with a chip select around it; it takes no time, so that the edges are exact.
static uint16_t transfer(uint16_t mosi, uint64_t t_ns)
{
    bt_emu_select(&device, true, t_ns);
    uint16_t miso = transfer16(&device, mosi, t_ns);
    bt_emu_select(&device, false, t_ns);
    return miso;
}

static uint16_t sample(uint8_t command, uint64_t t_ns)
{
    (void)transfer((uint16_t)(command << 8), t_ns);
    return transfer(BT_LISTEN_WORD, t_ns + 50000);
}

static int ones(unsigned byte)
{
    int n = 0;
    for (; byte != 0; byte >>= 1) {
        n += (int)(byte & 1);
    }
    return n;
}

TEST(fifty_microseconds_are_kept_to_the_nanosecond)
{
    for (uint64_t wait_ns = 49980; wait_ns <= 50020; wait_ns++) {
        new_device();
        (void)transfer(0xA200, 1000000);
        uint16_t word = transfer(BT_LISTEN_WORD, 1000000 + wait_ns);
        if (wait_ns < 50000) {
            assert_int_equal(word, 0xA52D);
            assert_int_equal(device.early_reads, 1);
        } else {
            assert_int_equal(word, 0x8001 | (2048 >> 5) << 9); // 1000000 P, 00000 00 P
            assert_int_equal(device.early_reads, 0);
        }
    }
}

TEST(no_other_word_is_taken_for_data)
{
    int good = 0;
    for (unsigned word = 0; word <= 0xFFFF; word++) {
        uint16_t count;
        enum bt_word kind = bt_word_decode((uint16_t)word, &count);
        bool odd = ones(word >> 8) % 2 == 1 && ones(word & 0xFF) % 2 == 1;
        assert_int_equal(kind == BT_WORD_GOOD, odd);
        assert_int_equal(kind == BT_WORD_STUCK, word == 0 || word == 0xFFFF);
        assert_int_equal(kind == BT_WORD_ERROR, !odd && word >> 8 == 0xA5);
        assert_true(kind == BT_WORD_GOOD ? count <= 4095 : count == BT_INVALID_COUNT);
        good += kind == BT_WORD_GOOD;
    }
    assert_int_equal(good, 128 * 128);
}

TEST(one_sample_is_never_answered_twice)
{
    assert_int_equal(transfer(BT_LISTEN_WORD, 10), BT_ERROR_WORD_NO_DATA);
    (void)sample(0xA2, 1000000);
    assert_int_equal(transfer(BT_LISTEN_WORD, 2000000), BT_ERROR_WORD_NO_DATA);
    bt_emu_select(&device, true, 3000000); // nor twice within one chip select
    (void)transfer16(&device, 0xA200, 3000000);
    bt_emu_select(&device, false, 3000000);
    bt_emu_select(&device, true, 3060000);
    assert_int_not_equal(transfer16(&device, BT_LISTEN_WORD, 3060000), BT_ERROR_WORD_NO_DATA);
    assert_int_equal(transfer16(&device, BT_LISTEN_WORD, 3064000), BT_ERROR_WORD_NO_DATA);
}

TEST(only_odd_command_bytes_are_obeyed)
{
    for (unsigned command = 0x80; command <= 0xFF; command++) {
        samples = 0;
        uint16_t word = sample((uint8_t)command, command * 1000000ull);
        if (ones(command) % 2 == 1) {
            assert_int_equal(samples, 1);
            assert_int_equal(asked_channel, (command & 0x7E) >> 1);
        } else {
            assert_int_equal(samples, 0);
            assert_int_equal(word, 0xA545);
        }
    }
}

TEST(unknown_commands_are_refused_by_word)
{
    assert_int_equal(sample(0x60, 0), 0xA53F);
    assert_int_equal(sample(0x61, 1000000), 0xA53F); // property 0x00
}

TEST(a_read_with_the_chip_select_still_low_has_no_answer)
{
    bt_emu_select(&device, true, 0);
    (void)transfer16(&device, 0xA200, 0);
    assert_int_equal(transfer16(&device, BT_LISTEN_WORD, 60000), 0xA52D);
    assert_int_equal(transfer16(&device, BT_LISTEN_WORD, 900000), 0xA52D);
    bt_emu_select(&device, false, 900000);
    assert_int_equal(transfer(BT_LISTEN_WORD, 950000) >> 9, 2048 >> 5);
}

TEST(resend_gives_the_last_word_again)
{
    static const uint8_t commands[] = {0x50, 0x20}; // the manual's, and SynTouch's library's
    assert_int_equal(sample(0x50, 0), 0xA55F);
    uint16_t first = sample(0xA2, 1000000);
    next_count = 99;
    for (unsigned k = 0; k < 4; k++) {
        assert_int_equal(sample(commands[k % 2], 2000000 + k * 1000000), first);
    }
    assert_int_equal(samples, 1);
}

TEST(nothing_can_be_written)
{
    (void)transfer(0x4017, 0); // variable 1, odd parity
    assert_int_equal(transfer(BT_LISTEN_WORD, 50000), 0xA552);
}

static uint8_t read_byte(uint64_t t_ns)
{
    bt_emu_select(&device, true, t_ns);
    uint8_t miso = bt_emu_transfer8(&device, 0, t_ns);
    bt_emu_select(&device, false, t_ns);
    return miso;
}

TEST(the_list_of_channels_is_pairs_and_an_end)
{
    (void)transfer(BT_PROPERTY_READ_COMMAND << 8 | 0x73, 0);
    for (unsigned slot = 0; slot < 44; slot++) {
        assert_int_equal(read_byte(50000 + 30000 * slot), bt_channel_command[bt_slot_channel[slot]]);
        assert_int_equal(read_byte(60000 + 30000 * slot), slot < 43 ? 0x01 : 0xFE);
    }
    assert_int_equal(read_byte(9000000), 0);
}

static void assert_predicted(uint64_t t_ns, bool settled)
{
    uint16_t ahead = bt_emu_word_ahead(&device, 0, settled, t_ns);
    bt_emu_device copy = device;
    bt_emu_select(&copy, true, t_ns);
    assert_int_equal(transfer16(&copy, BT_LISTEN_WORD, t_ns), ahead);
}

TEST(what_it_will_say_is_told_ahead)
{
    const uint16_t words[] = {0xA200, 0x6115, 0x0001, 0x0001, 0x6113, 0x0100, 0xA300, 0x0001,
                              0xFF00, 0x2000, 0x4000, 0x0001, 0x8000, 0x0000, 0x0000};
    const uint16_t counts[] = {2048,
                               BT_EMU_FAULT_BAD_PARITY,
                               BT_EMU_FAULT_STUCK_HIGH,
                               BT_EMU_FAULT_STUCK_LOW,
                               BT_EMU_FAULT_TOO_EARLY,
                               BT_EMU_FAULT_NO_CHANNEL};
    uint64_t t_ns = 1000000;
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
        next_count = counts[c];
        for (size_t w = 0; w < sizeof words / sizeof *words; w++) {
            (void)transfer(words[w], t_ns);
            assert_predicted(t_ns + 49999, device.settled);
            assert_predicted(t_ns + 50000, true);
            t_ns += 60000;
        }
    }
}

TEST(a_property_is_told_a_byte_further_on)
{
    (void)transfer(0x6115, 0);
    assert_int_equal(bt_emu_word_ahead(&device, 0, true, 0), 'B' << 8 | 'T');
    assert_int_equal(bt_emu_word_ahead(&device, 1, true, 0), 'T' << 8 | '0');
    assert_int_equal(bt_emu_word_ahead(&device, 16, true, 0), 0);
}
