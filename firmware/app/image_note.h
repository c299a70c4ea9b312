// An image's description, for flashers: a block of constants, found by the first 12 bytes at a multiple of 4
// anywhere in the image. `biotac flash` refuses an image without exactly one, or with one for another board.
// The build refuses to make such an image, by the same code (host/biotac/flash/note.py).
#ifndef BIOTAC_IMAGE_NOTE_H
#define BIOTAC_IMAGE_NOTE_H

#include "version.h"
#include "wire/messages_gen.h"

#include <stdint.h>

#define BT_IMAGE_NOTE_LAYOUT 2

// Little-endian, without gaps. A later layout may append fields; these stay where they are.
typedef struct {
    char magic[12]; // "BIOTAC image", without a final zero
    uint16_t layout;
    uint16_t board; // enum bt_board
    uint8_t firmware_version[3];
    uint8_t wire_major;
    uint8_t wire_minor;
    uint8_t zero[3];
    // Size and CRC of the whole image, with the four bytes of crc32 as zeros. tools/image/note.py writes them
    // once the image is linked. `biotac flash` compares them with the file before the first byte is written,
    // and later with the board's CRC of its own flash (HELLO's image_crc32).
    uint32_t image_bytes;
    uint32_t crc32;
} bt_image_note;
_Static_assert(sizeof(bt_image_note) == 32, "the flasher reads it byte by byte");

// HELLO has the same constants, so that an image answers as it claims.
#define BT_IMAGE_NOTE(board_)                                                                                \
    {                                                                                                        \
        .magic = {'B', 'I', 'O', 'T', 'A', 'C', ' ', 'i', 'm', 'a', 'g', 'e'},                               \
        .layout = BT_IMAGE_NOTE_LAYOUT,                                                                      \
        .board = (board_),                                                                                   \
        .firmware_version = {BT_VERSION_MAJOR, BT_VERSION_MINOR, BT_VERSION_PATCH},                          \
        .wire_major = BT_WIRE_MAJOR,                                                                         \
        .wire_minor = BT_WIRE_MINOR,                                                                         \
    }

#endif
