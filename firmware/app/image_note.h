// What an image says of itself, for whoever flashes it: a block of constants that is found by its first 12
// bytes, anywhere in the image at a multiple of 4. `biotac flash` refuses an image that has not exactly one,
// or one for another board, and by the same code (host/biotac/flash/note.py) the build refuses to make it.
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
    // Of the whole image from its first byte on, the four of crc32 taken as zeros. Written by
    // tools/image/note.py once the image is linked, held against the file by `biotac flash` before the first
    // byte is written, and against what the board computes of its own flash when it is back (HELLO's
    // image_crc32).
    uint32_t image_bytes;
    uint32_t crc32;
} bt_image_note;
_Static_assert(sizeof(bt_image_note) == 32, "the flasher reads it byte by byte");

// The same constants as HELLO's, so that what an image claims is what it will answer.
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
