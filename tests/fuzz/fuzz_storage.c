// The storage loader on a flash that holds anything: pages of noise, whole records of any id, size and
// version, sectors in use of any generation, bits flipped; then records are written, and power fails in the
// middle of some.
//
// A record read is a whole page's, and settings and calibrations made of it are in range. A record written is
// read back; after a failed write, the record before it or the new one.
#include "input.h"
#include "keep/calibration.h"
#include "keep/storage.h"
#include "wire/crc32.h"
#include "wire/little_endian.h"
#include "wire/messages_gen.h"

#include <string.h>

#define PAGES     (BT_STORAGE_BYTES / BT_FLASH_PAGE_BYTES)
#define IN_USE_ID 0xFFFE // of a sector's first page, as storage.c has it

static uint8_t flash_bytes[BT_STORAGE_BYTES];
static uint32_t bytes_left; // until power fails

static bool erase(void *context, uint32_t offset)
{
    (void)context;
    if (offset % BT_FLASH_SECTOR_BYTES != 0 || offset >= BT_STORAGE_BYTES) {
        FAIL("bad erase at %u", (unsigned)offset);
    }
    for (uint32_t k = 0; k < BT_FLASH_SECTOR_BYTES && bytes_left > 0; k++, bytes_left--) {
        flash_bytes[offset + k] = 0xFF;
    }
    return bytes_left > 0;
}

static bool program(void *context, uint32_t offset, const uint8_t *page)
{
    (void)context;
    if (offset % BT_FLASH_PAGE_BYTES != 0 || offset >= BT_STORAGE_BYTES) {
        FAIL("bad page program at %u", (unsigned)offset);
    }
    for (uint32_t k = 0; k < BT_FLASH_PAGE_BYTES && bytes_left > 0; k++, bytes_left--) {
        flash_bytes[offset + k] &= page[k];
    }
    return bytes_left > 0;
}

static void read_flash(void *context, uint32_t offset, uint8_t *data, size_t bytes)
{
    (void)context;
    if (offset + bytes > BT_STORAGE_BYTES) {
        FAIL("bad read of %zu bytes at %u", bytes, (unsigned)offset);
    }
    memcpy(data, flash_bytes + offset, bytes);
}

static const bt_flash flash = {BT_FLASH_SECTOR_BYTES, NULL, erase, program, read_flash};

typedef struct {
    int bytes; // -1: none
    uint16_t version;
    uint8_t data[BT_STORAGE_MAX_BYTES];
} record;

static record read_record(uint16_t id)
{
    record found = {.bytes = -1};
    found.bytes = bt_storage_read(&flash, id, &found.version, found.data, sizeof found.data);
    if (found.bytes < 0) {
        return found;
    }
    uint8_t wanted[BT_FLASH_PAGE_BYTES];
    for (int page = 0; page < PAGES; page++) {
        const uint8_t *at = flash_bytes + page * BT_FLASH_PAGE_BYTES;
        if (!bt_storage_page_is(at, id)) {
            continue;
        }
        memcpy(wanted, at, sizeof wanted);
        if (bt_get_u16(wanted + 6) == found.version && (int)bt_get_u32(wanted + 8) == found.bytes
            && memcmp(wanted + BT_STORAGE_HEADER_BYTES, found.data, (size_t)found.bytes) == 0) {
            return found;
        }
    }
    FAIL("record %u was read but is on no page", (unsigned)id);
}

static bool same(const record *a, const record *b)
{
    return a->bytes == b->bytes
           && (a->bytes < 0 || (a->version == b->version && memcmp(a->data, b->data, (size_t)a->bytes) == 0));
}

static void settings_are_in_range(uint16_t version, const uint8_t *data, size_t bytes)
{
    bt_settings settings;
    bt_settings_reset(&settings);
    bt_settings_unpack(&settings, version, data, bytes);
    bt_calibration calibration;
    bt_calibration_unpack(&calibration, version, data, bytes);
    (void)bt_calibration_apply(&calibration, &settings);
    for (uint8_t id = 0; id < UINT8_MAX; id++) {
        bt_settings copy = settings;
        if (bt_settings_has(id)
            && bt_settings_set(&copy, id, bt_settings_get(&settings, id)) != BT_ERROR_OK) {
            FAIL("setting %u is %d", (unsigned)id, (int)bt_settings_get(&settings, id));
        }
    }
}

static void write_record(fuzz_input *in)
{
    record old[BT_STORAGE_IDS + 1], fresh = {.bytes = next_u8(in) % (BT_STORAGE_MAX_BYTES + 1)};
    for (uint16_t other = 1; other <= BT_STORAGE_IDS; other++) {
        old[other] = read_record(other);
    }
    uint16_t id = (uint16_t)(1 + next_u8(in) % BT_STORAGE_IDS);
    fresh.version = next_u8(in);
    for (int k = 0; k < fresh.bytes; k++) {
        fresh.data[k] = (uint8_t)(k + fresh.version);
    }
    uint8_t cut = next_u8(in);
    bytes_left = cut == 0 ? UINT32_MAX : cut * 67u;
    bool kept = bt_storage_write(&flash, id, fresh.version, fresh.data, (size_t)fresh.bytes);
    bytes_left = UINT32_MAX;
    for (uint16_t other = 1; other <= BT_STORAGE_IDS; other++) {
        record now = read_record(other);
        bool is_new = other == id && same(&now, &fresh);
        if (!is_new && ((other == id && kept) || !same(&now, &old[other]))) {
            FAIL("record %u is wrong after a write of %u that %s", (unsigned)other, (unsigned)id,
                 kept ? "succeeded" : "failed");
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    fuzz_input in = {data, bytes};
    memset(flash_bytes, 0xFF, sizeof flash_bytes);
    bytes_left = UINT32_MAX;
    while (in.left > 0) {
        uint8_t step = next_u8(&in);
        uint8_t *page = flash_bytes + next_u8(&in) % PAGES * BT_FLASH_PAGE_BYTES;
        uint8_t size = next_u8(&in);
        uint8_t content[BT_FLASH_PAGE_BYTES];
        memset(content, size, sizeof content);
        for (int k = 0; k < 8; k++) {
            content[k] = next_u8(&in);
        }
        switch (step % 5) {
        case 0:
            memcpy(page, content, sizeof content);
            break;
        case 1:
            bt_storage_make_page(page, (uint16_t)(1 + content[4] % BT_STORAGE_IDS), content[5], content,
                                 size % (BT_STORAGE_MAX_BYTES + 1));
            break;
        case 2:
            bt_storage_make_page(flash_bytes + size % 2 * BT_FLASH_SECTOR_BYTES, IN_USE_ID, 0, content, 4);
            break;
        case 3:
            page[size] ^= content[0];
            break;
        default:
            write_record(&in);
            break;
        }
    }
    for (uint16_t id = 1; id <= BT_STORAGE_IDS; id++) {
        record found = read_record(id);
        if (found.bytes >= 0) {
            uint8_t *exact = malloc((size_t)found.bytes + 1); // so that a byte too many is noticed
            memcpy(exact, found.data, (size_t)found.bytes);
            settings_are_in_range(found.version, exact, (size_t)found.bytes);
            free(exact);
        }
    }
    return 0;
}
