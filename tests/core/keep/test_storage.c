// Records in flash whose power is cut at every byte of every erase and every program: after each cut the old
// record or the new one is there, whole, and the storage goes on working.
#include "support.h"

#include "keep/calibration.h"
#include "keep/storage.h"
#include "wire/little_endian.h"

#define NEIGHBOUR 7  // another record that must outlive everything
#define SAVES     40 // over two changes of sector

// ---- NOR flash on a failing supply -----------------------------------------------------------------

static uint8_t flash_bytes[BT_STORAGE_BYTES];
static long operations_left; // erases and programs that are still done before power fails; -1: it holds
static bool inside;     // it fails within the next one: of its bits that change some are done, all over it
static long steps_left; // bytes that are still erased or programmed before power fails; -1: it holds
static bool backwards;  // of a sector or page, the last byte first
static bool ragged;     // the byte at which power fails has only some of its bits done
static uint64_t seed = 1;
static long steps;
static int erases;
static jmp_buf power_fails;

static void step(size_t at, uint8_t value)
{
    uint8_t changing = (uint8_t)(flash_bytes[at] ^ value);
    if (steps_left == 0) {
        flash_bytes[at] ^= ragged ? (uint8_t)(changing & random_u64(&seed)) : 0;
        longjmp(power_fails, 1);
    }
    steps_left -= steps_left > 0;
    steps++;
    flash_bytes[at] = value;
}

static void operation(size_t at, size_t bytes, const uint8_t *page)
{
    if (operations_left == 0) {
        for (size_t k = 0; inside && k < bytes; k++) {
            uint8_t value = page == NULL ? 0xFF : flash_bytes[at + k] & page[k];
            flash_bytes[at + k] ^= (uint8_t)((flash_bytes[at + k] ^ value) & random_u64(&seed));
        }
        longjmp(power_fails, 1);
    }
    operations_left -= operations_left > 0;
}

static size_t in_order(size_t k, size_t bytes)
{
    return backwards ? bytes - 1 - k : k;
}

static bool erase(uint32_t offset)
{
    assert_true(offset % BT_FLASH_SECTOR_BYTES == 0 && offset < BT_STORAGE_BYTES);
    erases++;
    operation(offset, BT_FLASH_SECTOR_BYTES, NULL);
    for (size_t k = 0; k < BT_FLASH_SECTOR_BYTES; k++) {
        step(offset + in_order(k, BT_FLASH_SECTOR_BYTES), 0xFF);
    }
    return true;
}

static bool program(uint32_t offset, const uint8_t *page)
{
    assert_true(offset % BT_FLASH_PAGE_BYTES == 0 && offset < BT_STORAGE_BYTES);
    operation(offset, BT_FLASH_PAGE_BYTES, page);
    for (size_t k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        size_t at = offset + in_order(k, BT_FLASH_PAGE_BYTES);
        step(at, flash_bytes[at] & page[at - offset]); // programming never sets a bit
    }
    return true;
}

static void read_flash(uint32_t offset, uint8_t *data, size_t bytes)
{
    assert_true(offset + bytes <= BT_STORAGE_BYTES);
    memcpy(data, flash_bytes + offset, bytes);
}

static const bt_flash flash = {erase, program, read_flash};

static int new_flash(void **state)
{
    (void)state;
    memset(flash_bytes, 0xFF, sizeof flash_bytes);
    steps_left = operations_left = -1;
    backwards = ragged = inside = false;
    erases = 0;
    return 0;
}

// ---- records that tell which they are -----------------------------------------------------------------

static size_t make(uint8_t *data, uint16_t id, int number)
{
    size_t bytes = 20 + (size_t)(number * 7 + id) % 200;
    for (size_t k = 0; k < bytes; k++) {
        data[k] = (uint8_t)(number * 31 + id + (int)k);
    }
    return bytes;
}

static bool write_one(uint16_t id, int number)
{
    uint8_t data[BT_STORAGE_MAX_BYTES];
    size_t bytes = make(data, id, number);
    return bt_storage_write(&flash, id, (uint16_t)number, data, bytes);
}

// Which one is there, whole; -1 when none is.
static int stored(uint16_t id)
{
    uint8_t data[BT_STORAGE_MAX_BYTES], want[BT_STORAGE_MAX_BYTES];
    uint16_t version;
    int bytes = bt_storage_read(&flash, id, &version, data, sizeof data);
    if (bytes < 0) {
        assert_int_equal(bytes, -1);
        return -1;
    }
    assert_int_equal(bytes, make(want, id, version));
    assert_memory_equal(data, want, (size_t)bytes);
    return version;
}

static void a_new_flash_holds_nothing(void **state)
{
    (void)state;
    assert_int_equal(stored(BT_RECORD_SETTINGS), -1);
    memset(flash_bytes, 0, sizeof flash_bytes); // nor does one that is full of something else
    assert_int_equal(stored(BT_RECORD_SETTINGS), -1);
    assert_true(write_one(BT_RECORD_SETTINGS, 1));
    assert_int_equal(stored(BT_RECORD_SETTINGS), 1);
}

static void the_latest_record_of_each_id_is_found_over_many_writes(void **state)
{
    (void)state;
    int last[BT_STORAGE_IDS + 1] = {0};
    for (int number = 1; number < 1000; number++) {
        uint16_t id = (uint16_t)random_range(&seed, 1, BT_STORAGE_IDS);
        assert_true(write_one(id, number));
        last[id] = number;
        for (uint16_t other = 1; other <= BT_STORAGE_IDS; other++) {
            assert_int_equal(stored(other), last[other] == 0 ? -1 : last[other]);
        }
    }
    // Twelve of fifteen pages are taken after a change of sector: three writes lie between two, at least.
    assert_in_range(erases, 1000 / 15, 1000 / 4);
}

static void a_damaged_page_is_told(void **state)
{
    (void)state;
    assert_false(bt_storage_damaged(&flash)); // nothing was ever saved
    for (int number = 1; number <= SAVES; number++) {
        assert_true(write_one(1, number));
        assert_false(bt_storage_damaged(&flash));
    }
    size_t last = 0;
    for (size_t at = 0; at < sizeof flash_bytes; at += BT_FLASH_PAGE_BYTES) {
        last =
            bt_storage_page_is(flash_bytes + at, 1) && bt_get_u16(flash_bytes + at + 6) == SAVES ? at : last;
    }
    for (size_t at = last; at < last + BT_FLASH_PAGE_BYTES; at++) { // what is read is then an older one
        flash_bytes[at] ^= (uint8_t)(1u << at % 8);
        assert_true(bt_storage_damaged(&flash));
        assert_int_equal(stored(1), SAVES - 1);
        flash_bytes[at] ^= (uint8_t)(1u << at % 8);
    }
    const size_t used = last / BT_FLASH_SECTOR_BYTES * BT_FLASH_SECTOR_BYTES;
    flash_bytes[used] ^= 1; // the sector in use: what is read is then of the one before
    assert_true(bt_storage_damaged(&flash));
}

static void the_same_again_wears_nothing(void **state)
{
    (void)state;
    assert_true(write_one(1, 5));
    long before = steps;
    assert_true(write_one(1, 5));
    assert_int_equal(steps, before);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    uint8_t data[BT_STORAGE_MAX_BYTES + 1] = {0};
    assert_false(bt_storage_write(&flash, 1, 0, data, sizeof data));
    assert_false(bt_storage_write(&flash, 0, 0, data, 1));
    assert_false(bt_storage_write(&flash, BT_STORAGE_IDS + 1, 0, data, 1));
    assert_true(bt_storage_write(&flash, 1, 0, data, BT_STORAGE_MAX_BYTES));
}

static void generations_may_wrap(void **state)
{
    (void)state;
    assert_true(write_one(1, 0));
    // The sector in use claims generation 2^32 - 1; its CRC follows from its own bytes by a second CRC-32.
    uint8_t *page = flash_bytes;
    uint32_t crc = 0xFFFFFFFFu;
    memset(page + 16, 0xFF, 4);
    for (int k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        crc ^= k >= 12 && k < 16 ? 0xFF : page[k];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc & 1 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
    }
    crc = ~crc;
    for (int k = 0; k < 4; k++) {
        page[12 + k] = (uint8_t)(crc >> 8 * k);
    }
    assert_int_equal(stored(1), 0);
    for (int number = 1; number < SAVES; number++) {
        assert_true(write_one(1, number));
        assert_int_equal(stored(1), number);
    }
}

// ---- power cuts ----------------------------------------------------------------------------------------

// Save `number` with power failing after `cut` bytes. True when it was through before that.
static bool save_with_cut(int number, long cut)
{
    steps_left = cut;
    if (setjmp(power_fails) != 0) {
        steps_left = -1;
        return false;
    }
    assert_true(write_one(BT_RECORD_SETTINGS, number));
    steps_left = -1;
    return true;
}

static int cuts;

static void cut_everywhere(void)
{
    static uint8_t before[BT_STORAGE_BYTES];
    assert_true(write_one(NEIGHBOUR, 77));
    assert_true(write_one(BT_RECORD_SETTINGS, 0));
    for (int number = 1; number < SAVES; number++) {
        memcpy(before, flash_bytes, sizeof before);
        for (long cut = 0; !save_with_cut(number, cut); cut++) {
            cuts++;
            int found = stored(BT_RECORD_SETTINGS);
            assert_true(found == number - 1 || found == number);
            assert_int_equal(stored(NEIGHBOUR), 77);
            // What the cut left behind is no obstacle, and neither is a second cut in the next save.
            uint8_t after_cut[BT_STORAGE_BYTES];
            memcpy(after_cut, flash_bytes, sizeof after_cut);
            (void)save_with_cut(500, (long)random_range(&seed, 0, 5000));
            int again = stored(BT_RECORD_SETTINGS);
            assert_true(again == found || again == 500);
            memcpy(flash_bytes, after_cut, sizeof after_cut);
            assert_true(write_one(BT_RECORD_SETTINGS, 999));
            assert_int_equal(stored(BT_RECORD_SETTINGS), 999);
            assert_int_equal(stored(NEIGHBOUR), 77);
            memcpy(flash_bytes, before, sizeof before);
        }
        assert_int_equal(stored(BT_RECORD_SETTINGS), number);
    }
    assert_in_range(erases, 3, 1000000);
}

static void a_cut_at_any_byte_leaves_the_old_record_or_the_new(void **state)
{
    (void)state;
    cuts = 0;
    cut_everywhere();
    // Every save programs a page at least; two change the sector, which erases one and programs two more.
    assert_true(cuts >= (SAVES - 1) * BT_FLASH_PAGE_BYTES + 2 * BT_FLASH_SECTOR_BYTES);
}

static void nor_does_the_order_within_a_page_matter(void **state)
{
    (void)state;
    backwards = true;
    cut_everywhere();
}

static void nor_do_half_done_bytes(void **state)
{
    (void)state;
    ragged = true;
    cut_everywhere();
}

// ---- all that a board saves ----------------------------------------------------------------------------

#define FINGERS  5
#define ALL_CUTS 4 // saves of settings and five calibrations that are cut; sectors change twice

// Settings and calibrations that tell which save they are of.
static void save_all(int number)
{
    uint8_t settings_record[BT_SETTINGS_RECORD_BYTES], record[BT_CALIBRATION_RECORD_BYTES];
    bt_settings settings;
    bt_settings_reset(&settings);
    assert_int_equal(bt_settings_set(&settings, BT_SETTING_IDLE_PERIOD_MS, 100 + number), BT_ERROR_OK);
    bt_settings_pack(&settings, settings_record);
    assert_true(bt_storage_write(&flash, BT_RECORD_SETTINGS, BT_SETTINGS_RECORD_VERSION, settings_record,
                                 sizeof settings_record));
    for (int f = 0; f < FINGERS; f++) {
        bt_calibration its = {.present = true, .made_s = (uint32_t)(1000 * f + number)};
        for (int k = 1; k < BT_CALIBRATION_VALUES; k++) {
            its.value[k] = 100 * f + 10 * k - number;
        }
        size_t bytes = bt_calibration_pack(&its, record);
        assert_true(bt_storage_write(&flash, (uint16_t)(BT_RECORD_CALIBRATION + f),
                                     BT_CALIBRATION_RECORD_VERSION, record, bytes));
    }
}

static int stored_settings(void)
{
    uint8_t record[BT_STORAGE_MAX_BYTES];
    uint16_t version;
    bt_settings settings;
    bt_settings_reset(&settings);
    int bytes = bt_storage_read(&flash, BT_RECORD_SETTINGS, &version, record, sizeof record);
    assert_int_equal(bytes, BT_SETTINGS_RECORD_BYTES);
    bt_settings_unpack(&settings, version, record, (size_t)bytes);
    return bt_settings_get(&settings, BT_SETTING_IDLE_PERIOD_MS) - 100;
}

static int stored_calibration(int f)
{
    uint8_t record[BT_STORAGE_MAX_BYTES];
    uint16_t version;
    bt_calibration its;
    int bytes =
        bt_storage_read(&flash, (uint16_t)(BT_RECORD_CALIBRATION + f), &version, record, sizeof record);
    assert_int_equal(bytes, BT_CALIBRATION_RECORD_BYTES);
    bt_calibration_unpack(&its, version, record, (size_t)bytes);
    assert_true(its.present);
    int number = (int)its.made_s - 1000 * f;
    for (int k = 1; k < BT_CALIBRATION_VALUES; k++) {
        assert_int_equal(its.value[k], 100 * f + 10 * k - number);
    }
    return number;
}

// `left` counts down to the cut.
static bool save_all_with_cut(int number, long *left, long cut)
{
    *left = cut;
    if (setjmp(power_fails) != 0) {
        *left = -1;
        return false;
    }
    save_all(number);
    *left = -1;
    return true;
}

// They are written one after the other: where the old one begins, the rest is old.
static void assert_old_then_new(int number)
{
    int found = stored_settings();
    assert_true(found == number || found == number - 1);
    for (int f = 0; f < FINGERS; f++) {
        int next = stored_calibration(f);
        assert_true(next == found || (found == number && next == number - 1));
        found = next;
    }
}

static void each_record_of_a_save_that_is_cut_is_the_old_one_or_the_new(void **state)
{
    (void)state;
    static uint8_t before[BT_STORAGE_BYTES];
    save_all(0);
    for (int number = 1; number <= ALL_CUTS; number++) {
        memcpy(before, flash_bytes, sizeof before);
        for (long cut = 0; !save_all_with_cut(number, &steps_left, cut); cut++) {
            assert_old_then_new(number);
            memcpy(flash_bytes, before, sizeof before);
        }
        assert_int_equal(stored_calibration(FINGERS - 1), number);
    }
    assert_true(erases > 2 * BT_FLASH_SECTOR_BYTES); // a cut at every byte of two erases, at least
}

// Cells of a sector that is erased, or of a page that is programmed, are done in no order: seed 17.
static void so_it_is_before_every_operation_and_wherever_inside_of_one_power_fails(void **state)
{
    (void)state;
    static uint8_t before[BT_STORAGE_BYTES];
    int at = 0, within = 0;
    seed = 17;
    save_all(0);
    for (int number = 1; number <= 2 * ALL_CUTS; number++) {
        memcpy(before, flash_bytes, sizeof before);
        for (int turn = 0; turn < 4; turn++) {
            inside = turn > 0;
            memcpy(flash_bytes, before, sizeof before);
            for (long cut = 0; !save_all_with_cut(number, &operations_left, cut); cut++) {
                *(inside ? &within : &at) += 1;
                assert_old_then_new(number);
                save_all(number); // what the cut left behind is no obstacle
                assert_int_equal(stored_settings(), number);
                assert_int_equal(stored_calibration(FINGERS - 1), number);
                memcpy(flash_bytes, before, sizeof before);
            }
        }
    }
    print_message("settings and calibrations: power cut before %d operations, inside %d\n", at, within);
    assert_in_range(at, 50, 1000);
    assert_in_range(within, 150, 1000);
}

// ---- settings ------------------------------------------------------------------------------------------

static void settings_come_back_and_others_keep_their_defaults(void **state)
{
    (void)state;
    bt_settings settings, back;
    uint8_t record[BT_SETTINGS_RECORD_BYTES + 7];
    bt_settings_reset(&settings);
    for (int k = 0; k < BT_SETTINGS; k++) {
        settings.value[k] = k % 2 == 0 ? bt_setting_specs[k].min : bt_setting_specs[k].max;
    }
    bt_settings_pack(&settings, record);
    bt_settings_reset(&back);
    bt_settings_unpack(&back, BT_SETTINGS_RECORD_VERSION, record, BT_SETTINGS_RECORD_BYTES);
    assert_memory_equal(&back, &settings, sizeof back);
    // An unknown id, a value out of range and half a pair are passed over.
    memcpy(record + BT_SETTINGS_RECORD_BYTES, "\xFA\1\0\0\0\1\2", 7);
    record[1] = record[2] = record[3] = record[4] = 0x7F;
    bt_settings_reset(&back);
    settings.value[0] = bt_setting_specs[0].initial;
    bt_settings_unpack(&back, BT_SETTINGS_RECORD_VERSION, record, sizeof record);
    assert_memory_equal(&back, &settings, sizeof back);
    bt_settings_reset(&back);
    bt_settings_unpack(&back, BT_SETTINGS_RECORD_VERSION + 1, record, sizeof record);
    bt_settings_reset(&settings);
    assert_memory_equal(&back, &settings, sizeof back);
}

// Whoever saved settings with a firmware before wire 1.5 goes on with the force that it computed.
static void a_record_without_the_force_model_means_lins(void **state)
{
    (void)state;
    bt_settings settings;
    uint8_t record[BT_SETTINGS_RECORD_BYTES];
    bt_settings_reset(&settings);
    assert_int_equal(bt_settings_get(&settings, BT_SETTING_FORCE_MODEL), BT_FORCE_MODEL_POPULATION);
    bt_settings_pack(&settings, record);
    const size_t without = (BT_SETTING_FORCE_MODEL - 1) * BT_SETTING_PAIR_BYTES; // it and what came later
    assert_int_equal(record[without], BT_SETTING_FORCE_MODEL);
    bt_settings_unpack(&settings, BT_SETTINGS_RECORD_VERSION, record, without);
    assert_int_equal(bt_settings_get(&settings, BT_SETTING_FORCE_MODEL), BT_FORCE_MODEL_LIN);
    bt_settings_unpack(&settings, BT_SETTINGS_RECORD_VERSION, record, sizeof record);
    assert_int_equal(bt_settings_get(&settings, BT_SETTING_FORCE_MODEL), BT_FORCE_MODEL_POPULATION);
    for (int k = 0; k < BT_SETTINGS; k++) {
        settings.value[k] = bt_setting_specs[k].before + 1;
    }
    bt_settings_unpack(&settings, BT_SETTINGS_RECORD_VERSION, record, 0);
    for (int k = 0; k < BT_SETTINGS; k++) { // likewise of every other
        assert_int_equal(settings.value[k], bt_setting_specs[k].before);
    }
}

static void no_more_is_read_than_there_is_or_there_is_room_for(void **state)
{
    (void)state;
    uint8_t data[BT_STORAGE_MAX_BYTES], out[BT_STORAGE_MAX_BYTES];
    uint16_t version;
    memset(data, 0x5A, sizeof data);
    for (size_t bytes = 0; bytes <= sizeof data; bytes += sizeof data / 4) {
        assert_true(bt_storage_write(&flash, 3, 1, data, bytes));
        for (size_t room = 0; room <= sizeof out; room += sizeof out / 4) {
            memset(out, 1, sizeof out);
            assert_int_equal(bt_storage_read(&flash, 3, &version, out, room), bytes);
            for (size_t k = 0; k < sizeof out; k++) {
                assert_int_equal(out[k], k < bytes && k < room ? 0x5A : 1);
            }
        }
    }
}

#define T(test) cmocka_unit_test_setup(test, new_flash)

int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_new_flash_holds_nothing),
        T(the_latest_record_of_each_id_is_found_over_many_writes),
        T(a_damaged_page_is_told),
        T(the_same_again_wears_nothing),
        T(what_does_not_fit_is_refused),
        T(generations_may_wrap),
        T(a_cut_at_any_byte_leaves_the_old_record_or_the_new),
        T(nor_does_the_order_within_a_page_matter),
        T(nor_do_half_done_bytes),
        T(each_record_of_a_save_that_is_cut_is_the_old_one_or_the_new),
        T(so_it_is_before_every_operation_and_wherever_inside_of_one_power_fails),
        T(settings_come_back_and_others_keep_their_defaults),
        T(a_record_without_the_force_model_means_lins),
        T(no_more_is_read_than_there_is_or_there_is_room_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
