// The chip's boot ROM: functions by two-letter names (data sheet 5.4). It differs from the RP2040's: one
// look-up that knows the table, a mask for a function's users, and one call for every way to restart.
#include "system.h"

typedef void *(*rom_lookup)(uint32_t code, uint32_t mask);
typedef int (*rom_reboot)(uint32_t flags, uint32_t delay_ms, uint32_t first, uint32_t second);

#define FOR_ARM_SECURE    4u
#define REBOOT_TO_BOOTSEL 2u
#define REBOOT_NO_RETURN  0x100u
#define REBOOT_AFTER_MS   10u

// A 16-bit pointer in the ROM, at an address from the linker script: the compiler treats so low a number as a
// stray null pointer.
extern const volatile uint16_t rom_table_lookup; // 0x16

void *rom_function(char first, char second)
{
    rom_lookup lookup = (rom_lookup)(uintptr_t)rom_table_lookup;
    if (lookup == NULL) {
        return NULL; // no ROM: an emulator without one
    }
    return lookup((uint32_t)(uint8_t)first | (uint32_t)(uint8_t)second << 8, FOR_ARM_SECURE);
}

bool rom_has_loader(void)
{
    return rom_function('R', 'B') != NULL;
}

void rom_enter_loader(void)
{
    rom_reboot reboot = (rom_reboot)rom_function('R', 'B');
    if (reboot != NULL) {
        (void)reboot(REBOOT_TO_BOOTSEL | REBOOT_NO_RETURN, REBOOT_AFTER_MS, 0,
                     0); // both the drive and PICOBOOT on
    }
    system_reset();
}
