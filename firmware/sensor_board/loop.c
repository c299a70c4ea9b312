// The label is erased first and written last: a power failure leaves no tape, never half of one.
#include "loop.h"

#include "keep/storage.h"
#include "map/store.h"
#include "only_board.h"
#include "system.h"
#include "wire/crc32.h"

#include <string.h>

#define MAGIC 0x504F4F4Cu // "LOOP"

typedef struct {
    uint32_t magic;
    uint32_t fingers;
    uint32_t slots;
    uint32_t crc32; // of the samples
} label;

#define LABEL_AT   BT_STORAGE_BYTES // as port.h counts; a whole sector
#define SAMPLE_AT  (LABEL_AT + BT_FLASH_SECTOR_BYTES)
#define MOST_BYTES (BT_MAPS_BYTES - BT_FLASH_SECTOR_BYTES)

static struct {
    bool open;
    const uint8_t *samples;
    uint32_t bytes;
    uint32_t at; // bytes of them written
    label label;
} writing;

static uint32_t known_slots;

static const label *stored_label(void)
{
    return (const label *)(const void *)flash_maps();
}

static const uint8_t *stored_samples(void)
{
    return flash_maps() + BT_FLASH_SECTOR_BYTES;
}

static uint32_t look(void)
{
    const label *found = stored_label();
    bool sane = found->magic == MAGIC && found->fingers >= 1 && found->fingers <= BT_MAX_FINGERS
                && found->slots > 0 && found->slots % BT_SLOTS == 0
                && found->slots <= MOST_BYTES / 2 / found->fingers;
    return sane && bt_crc32(stored_samples(), 2 * found->slots * found->fingers) == found->crc32
               ? found->slots
               : 0;
}

uint32_t loop_slots(void)
{
    return known_slots;
}

void loop_play(bt_emu_stream *stream)
{
    known_slots = look();
    if (known_slots != 0) {
        bt_emu_stream_loop(stream, (const uint16_t *)(const void *)stored_samples(),
                           (uint8_t)stored_label()->fingers, known_slots);
    }
}

uint8_t loop_store(const bt_emu_stream *stream, uint32_t slots, uint32_t crc32)
{
    const uint8_t *samples = (const uint8_t *)bt_emu_stream_whole(stream);
    uint32_t bytes = 2 * stream->written * stream->fingers;
    if (slots != 0
        && (samples == NULL || slots != stream->written || bytes > MOST_BYTES
            || bt_crc32(samples, bytes) != crc32)) {
        return BT_ERROR_NOT_WHOLE;
    }
    writing.label = (label){MAGIC, stream->fingers, slots, crc32};
    writing.samples = samples;
    writing.bytes = slots != 0 ? bytes : 0;
    writing.at = 0;
    writing.open = true;
    known_slots = 0;
    return BT_ERROR_OK;
}

static bool write_sector(void)
{
    bool done = port_flash_erase(ONLY_BOARD, SAMPLE_AT + writing.at);
    for (uint32_t k = 0; done && k < BT_FLASH_SECTOR_BYTES && writing.at < writing.bytes;
         k += BT_FLASH_PAGE_BYTES) {
        done = port_flash_program(ONLY_BOARD, SAMPLE_AT + writing.at, writing.samples + writing.at);
        writing.at += BT_FLASH_PAGE_BYTES;
    }
    return done;
}

static bool write_label(void)
{
    uint8_t page[BT_FLASH_PAGE_BYTES];
    memset(page, 0xFF, sizeof page);
    memcpy(page, &writing.label, sizeof writing.label);
    return port_flash_program(ONLY_BOARD, LABEL_AT, page);
}

void loop_poll(void)
{
    if (!writing.open) {
        return;
    }
    bool done = writing.at > 0 || port_flash_erase(ONLY_BOARD, LABEL_AT);
    if (done && writing.at < writing.bytes) {
        done = write_sector();
    }
    if (done && writing.at < writing.bytes) {
        return;
    }
    writing.open = false;
    if (done && writing.bytes != 0 && write_label()) {
        known_slots = look(); // none, if the tape changed meanwhile
    }
}
