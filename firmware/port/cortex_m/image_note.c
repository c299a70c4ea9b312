// This image's note; the linker script keeps it. And whether flash holds the image that the note was made
// for.
#include "image_note.h"

#include "cortex_m.h"
#include "pins.h"

#include "wire/crc32.h"

// volatile: the build fills in size and CRC after the compiler has seen them as zeros.
__attribute__((section(".image_note"), used)) static const volatile bt_image_note note =
    BT_IMAGE_NOTE(IMAGE_BOARD);

#define IMAGE_MAX_BYTES (2u * 1024 * 1024)

extern const uint8_t image_stored[]; // the linker script's: where the image begins

uint32_t image_crc32(void)
{
    const uint32_t crc_at = (uint32_t)((uintptr_t)&note.crc32 - (uintptr_t)image_stored);
    const uint32_t bytes = note.image_bytes < IMAGE_MAX_BYTES ? note.image_bytes : 0;
    uint32_t crc = BT_CRC32_START;
    for (uint32_t k = 0; k < bytes; k++) {
        crc = bt_crc32_step(crc, k - crc_at < sizeof note.crc32 ? 0 : image_stored[k]);
    }
    return bt_crc32_end(crc);
}
