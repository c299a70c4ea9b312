// Power is cut at every byte of every erase and every program of a record in flash: after each cut the old
// record or the new one is there, whole, and the storage goes on working.
#include "failing_flash.h"
#include "support.h"

#include "keep/storage.h"
#include "wire/little_endian.h"

#ifndef SECTOR // tests/CMakeLists.txt overrides it for a chip with larger ones
#define SECTOR BT_FLASH_SECTOR_BYTES
#endif
#define TIMES      (SECTOR / BT_FLASH_SECTOR_BYTES)
#define STRIDE     (TIMES == 1 ? 1 : 13) // bytes from one cut to the next; operations are cut one by one
#define NEIGHBOURS 5                     // other records, which must outlive everything
#define SAVES      (40 * TIMES)          // over two changes of sector

static uint8_t bytes_of_flash[2 * SECTOR];
static failing_flash nor;

static bool erase(void *context, uint32_t offset)
{
    (void)context;
    assert_true(offset % SECTOR == 0 && offset < 2 * SECTOR);
    flash_erase(&nor, offset);
    return true;
}

static bool program(void *context, uint32_t offset, const uint8_t *page)
{
    (void)context;
    assert_true(offset % BT_FLASH_PAGE_BYTES == 0 && offset < 2 * SECTOR);
    flash_program(&nor, offset, page);
    return true;
}

static void read_flash(void *context, uint32_t offset, uint8_t *data, size_t bytes)
{
    (void)context;
    assert_true(offset + bytes <= 2 * SECTOR);
    memcpy(data, bytes_of_flash + offset, bytes);
}

static const bt_flash flash = {SECTOR, NULL, erase, program, read_flash};

BEFORE_EACH(new_flash)
{
    flash_new(&nor, bytes_of_flash, sizeof bytes_of_flash);
    nor.sector_bytes = SECTOR;
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

static bool write_record(uint16_t id, int number)
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

TEST(a_damaged_page_is_told)
{
    assert_false(bt_storage_damaged(&flash)); // nothing was ever saved
    for (int number = 1; number <= SAVES; number++) {
        assert_true(write_record(1, number));
        assert_false(bt_storage_damaged(&flash));
    }
    size_t last = 0;
    for (size_t at = 0; at < sizeof bytes_of_flash; at += BT_FLASH_PAGE_BYTES) {
        last = bt_storage_page_is(bytes_of_flash + at, 1) && bt_get_u16(bytes_of_flash + at + 6) == SAVES
                   ? at
                   : last;
    }
    for (size_t at = last; at < last + BT_FLASH_PAGE_BYTES; at++) { // an older record is read then
        bytes_of_flash[at] ^= (uint8_t)(1u << at % 8);
        assert_true(bt_storage_damaged(&flash));
        assert_int_equal(stored(1), SAVES - 1);
        bytes_of_flash[at] ^= (uint8_t)(1u << at % 8);
    }
    const size_t used = last / SECTOR * SECTOR;
    bytes_of_flash[used] ^= 1; // the sector in use: the record before is read then
    assert_true(bt_storage_damaged(&flash));
}

TEST(a_page_that_takes_nothing_without_a_word_is_never_taken_for_a_record)
{
    for (long dud = 0; dud < (long)sizeof bytes_of_flash; dud += BT_FLASH_PAGE_BYTES) {
        int last[2] = {-1, -1};
        new_flash();
        nor.dud = dud;
        for (int number = 1; number <= SAVES; number++) {
            int *kept = &last[number % 2];
            *kept = write_record((uint16_t)(1 + number % 2), number) ? number : *kept;
            assert_true(stored(1) == last[0] && stored(2) == last[1]);
        }
    }
}

// ---- power cuts ----------------------------------------------------------------------------------------

// Save `number`; power fails when `left` has counted down from `cut`. True when the save ended before that.
static bool save_with_cut(int number, long *left, long cut)
{
    *left = cut;
    if (setjmp(nor.power_fails) != 0) {
        *left = -1;
        return false;
    }
    assert_true(write_record(BT_RECORD_SETTINGS, number));
    *left = -1;
    return true;
}

static void assert_neighbours_are_whole(void)
{
    for (uint16_t id = BT_RECORD_CALIBRATION; id < BT_RECORD_CALIBRATION + NEIGHBOURS; id++) {
        assert_int_equal(stored(id), 77 + id);
    }
}

// Returns how many cuts there were.
static int cut_everywhere(long *left, long stride)
{
    static uint8_t before[2 * SECTOR];
    int cuts = 0;
    for (uint16_t id = BT_RECORD_CALIBRATION; id < BT_RECORD_CALIBRATION + NEIGHBOURS; id++) {
        assert_true(write_record(id, 77 + id));
    }
    assert_true(write_record(BT_RECORD_SETTINGS, 0));
    for (int number = 1; number < SAVES; number++) {
        memcpy(before, bytes_of_flash, sizeof before);
        for (long cut = 0; !save_with_cut(number, left, cut); cut += stride) {
            cuts++;
            int found = stored(BT_RECORD_SETTINGS);
            assert_true(found == number - 1 || found == number);
            assert_neighbours_are_whole();
            // The remains of a cut are no obstacle, and neither is a second cut in the next save.
            uint8_t after_cut[2 * SECTOR];
            memcpy(after_cut, bytes_of_flash, sizeof after_cut);
            (void)save_with_cut(500, &nor.bytes_left, (long)random_range(&nor.seed, 0, 5000));
            int again = stored(BT_RECORD_SETTINGS);
            assert_true(again == found || again == 500);
            memcpy(bytes_of_flash, after_cut, sizeof after_cut);
            assert_true(write_record(BT_RECORD_SETTINGS, 999));
            assert_int_equal(stored(BT_RECORD_SETTINGS), 999);
            assert_neighbours_are_whole();
            memcpy(bytes_of_flash, before, sizeof before);
        }
        assert_int_equal(stored(BT_RECORD_SETTINGS), number);
    }
    assert_in_range(nor.erases, 3, 1000000);
    return cuts;
}

// In any order within a page, and with the last byte half done.
TEST(a_cut_at_any_byte_leaves_the_old_record_or_the_new)
{
    for (int turn = 0; turn < 3; turn++) {
        new_flash();
        nor.backwards = turn == 1;
        nor.ragged = turn == 2;
        // Every save programs a page at least; two change the sector, which erases one and programs more.
        assert_true(cut_everywhere(&nor.bytes_left, STRIDE)
                    >= ((SAVES - 1) * BT_FLASH_PAGE_BYTES + 2 * SECTOR) / STRIDE);
    }
}

// Cells of a sector that is erased, or of a page that is programmed, are done in no order.
TEST(nor_where_and_how_an_operation_is_cut)
{
    for (int turn = 0; turn < 4; turn++) {
        nor.inside = turn > 0;
        assert_true(cut_everywhere(&nor.operations_left, 1) >= SAVES);
    }
}
