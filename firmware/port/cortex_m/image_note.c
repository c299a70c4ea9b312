// This image's note, retained by the linker script, and the check that the running image is the noted one.
#include "image_note.h"

#include "cortex_m.h"
#include "pins.h"

#include "wire/crc32.h"

// volatile: the build fills in size and CRC after the compiler has seen them as zeros.
__attribute__((section(".image_note"), used)) static const volatile bt_image_note note =
    BT_IMAGE_NOTE(IMAGE_BOARD);

// From the linker script: the image's start, and the part in RAM with the place it is copied from.
extern const uint8_t image_stored[], image_ram_from[], image_ram_start[];

// Only checked code runs. The table lies in the copy: a wrong one makes a wrong CRC.
AT_BOOT bool image_is_whole(void)
{
    const uint8_t *at = image_stored;
    uint32_t crc = BT_CRC32_START;
    for (uint32_t left = note.image_bytes; left != 0; left--, at++) {
        at = at == image_ram_from ? image_ram_start : at;
        const bool zeroed = (uintptr_t)at - (uintptr_t)&note.crc32 < sizeof note.crc32;
        crc = bt_crc32_step(crc, zeroed ? 0 : *at);
    }
    return note.image_bytes == 0 || bt_crc32_end(crc) == note.crc32;
}

uint32_t image_crc32(void)
{
    return note.crc32;
}
