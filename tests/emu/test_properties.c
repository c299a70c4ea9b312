// Properties at power-up: read twice, with gaps, and no damaged text taken for a value.
#include "rig.h"

#include "properties.h"

static const uint64_t flip_ns = 1000000;

// Faults of the line by time since it was first asked; NULL: none.
static uint16_t (*line)(uint64_t n);
static uint64_t asked;

static uint16_t faulty_source(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    (void)context;
    (void)finger;
    (void)t_ns;
    return channel == BT_EMU_LINE ? (line == NULL ? 0 : line(asked++)) : 2048;
}

BEFORE_EACH(new_bus)
{
    line = NULL;
    asked = 0;
    fake_reset(faulty_source, flip_ns);
}

static void read_all(uint8_t finger, bt_msg_sensor_info *info)
{
    bt_serial_query query = {0};
    bt_properties_read(ONLY_BOARD, finger, &query, info);
}

static void assert_all_are_known(const bt_msg_sensor_info *info)
{
    assert_memory_equal(info->serial, "BTEMU00000000001", 16);
    assert_memory_equal(info->software_version, "0301", 4);
    assert_memory_equal(info->flex_version, "BD", 2);
    assert_int_equal(info->cpu_khz, 16000);
    assert_int_equal(info->sampling_hz, 4400);
}

// Properties may come in any way. Plugged in later: tests/hil/test_bus_faults.py.
TEST(all_are_read_with_gaps_between_the_bytes)
{
    static const enum bt_emu_kind kinds[] = {BT_EMU_ANY, BT_EMU_WORDS, BT_EMU_HELD, BT_EMU_BYTES};
    for (unsigned k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        bt_msg_sensor_info info;
        new_bus();
        fake.bus.sensor[0].kind = kinds[k];
        read_all(0, &info);
        assert_int_equal(info.present, 1);
        assert_all_are_known(&info);
        assert_true(fake.shortest_gap_ns >= 10000);
        assert_int_equal(fake.bus.sensor[0].early_reads, 0);
    }
}

static uint64_t flipped;

static uint16_t flip_bit(uint64_t n)
{
    return n == flipped ? BT_EMU_FAULT_BAD_PARITY : 0;
}

TEST(one_flipped_bit_anywhere_changes_nothing)
{
    for (flipped = 0; flipped < 80; flipped++) {
        bt_msg_sensor_info info;
        new_bus();
        line = flip_bit;
        read_all(0, &info);
        assert_all_are_known(&info);
    }
}

// One round of a query: so many readings of a text. Returns whether it is sure.
static bool answers(bt_serial_query *query, const char *text, int readings)
{
    uint8_t serial[BT_SERIAL_BYTES];
    bt_serial_query_begin(query);
    for (int k = 1; k <= readings; k++) {
        memcpy(query->read[k].got, text, BT_SERIAL_BYTES);
    }
    query->whole = (uint8_t)(readings + 1);
    return bt_serial_query_answer(query, serial);
}

TEST(a_serial_number_has_its_letters_and_digits_and_two_forms_or_three_readings)
{
    static const struct {
        const char *text;
        int words, bytes;
        bool sure;
    } round[] = {{"BTEMU00000000001", 3, 0, true},  {"BTEMU00000000001", 2, 0, false},
                 {"BTEMU00000000001", 1, 1, true},  {"ATEMU00000000001", 3, 0, false},
                 {"BTEMUA0000000001", 3, 0, false}, {"BTEMU00A00000001", 3, 0, false}};
    for (unsigned k = 0; k < sizeof round / sizeof *round; k++) {
        bt_serial_query query = {.form = BT_FORM_WORDS};
        bool sure = answers(&query, round[k].text, round[k].words);
        query.form = BT_FORM_BYTES;
        sure = round[k].bytes == 0 ? sure : answers(&query, round[k].text, round[k].bytes);
        assert_int_equal(sure, round[k].sure);
    }
}

// A BioTac SP has 24 electrodes, elsewhere: the counts come, and no force of them is ever sure.
TEST(a_sensor_of_another_type_is_named_and_never_sure)
{
    static const char *const serial[] = {"BTSP050400018017", "BTTB050400018017"};
    for (int k = 0; k < 2; k++) {
        bt_msg_sensor_info info;
        memcpy(fake.bus.sensor[k].serial, serial[k], 16);
        read_all((uint8_t)k, &info);
        assert_int_equal(info.present, 0);
        assert_memory_equal(info.serial, serial[k], 16);
    }
    trouble.finger = 2;
    trouble.period = 1;
    trouble.fault = BT_EMU_FAULT_BAD_PARITY;
    boot(START_NS);
    memcpy(fake.bus.sensor[2].serial, serial[0], 16); // plugged in while sampling goes on
    trouble.period = 0;
    run_rounds(300);
    assert_int_equal(gateway.session.info[2].present, 0);
    assert_true(host.frames[2] > 200);
    for (int k = 0; k < host.frames[2]; k++) {
        assert_true(host.frame[2][k].flags & BT_FRAME_FLAG_SENSOR_UNSURE);
        assert_true(k < 40 || host.frame[2][k].force_100un[2] == BT_INVALID_I32);
    }
}
