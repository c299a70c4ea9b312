// IMAGE_DEF: the block, within the image's first 4 KiB, without which the chip's ROM starts nothing (data
// sheet 5.9). One item is the image type, and the link leads to the block itself: there is no other. The ROM
// then expects the vector table at the image's first byte.
#include <stdint.h>

#define BLOCK_START      0xFFFFDED3u
#define BLOCK_END        0xAB123579u
#define ITEM_IMAGE_TYPE  (0x42u | 1u << 8)                   // of one word
#define EXE_ARM_SECURE   (1u | 2u << 4 | 0u << 8 | 1u << 12) // executable, Secure, Arm, RP2350
#define ITEM_LAST(words) (0xFFu | (uint32_t)(words) << 8)
#define LINK_TO_ITSELF   0u

__attribute__((section(".image_def"), used)) static const uint32_t image_def[] = {
    BLOCK_START, ITEM_IMAGE_TYPE | EXE_ARM_SECURE << 16, ITEM_LAST(1), LINK_TO_ITSELF, BLOCK_END,
};
