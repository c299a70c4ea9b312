// This image's note. Nothing in the program reads it: the linker script keeps it.
#include "image_note.h"

__attribute__((section(".image_note"), used)) static const bt_image_note note = BT_IMAGE_NOTE(BT_BOARD_PICO);
