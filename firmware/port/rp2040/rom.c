// The chip's boot ROM: a table of functions by two-letter names (data sheet 2.8.3).
#include "system.h"

typedef void *(*rom_lookup)(const uint16_t *table, uint32_t code);
typedef void (*rom_loader)(uint32_t activity_pins, uint32_t disabled_interfaces);

// 16-bit pointers in the ROM, at addresses from the linker script: the compiler treats so low a number as a
// stray null pointer.
extern const volatile uint16_t rom_func_table;   // 0x14
extern const volatile uint16_t rom_table_lookup; // 0x18

void *rom_function(char first, char second)
{
    rom_lookup lookup = (rom_lookup)(uintptr_t)rom_table_lookup;
    if (lookup == NULL) {
        return NULL; // no ROM: an emulator without one
    }
    return lookup((const uint16_t *)(uintptr_t)rom_func_table,
                  (uint32_t)(uint8_t)first | (uint32_t)(uint8_t)second << 8);
}

bool rom_has_loader(void)
{
    return rom_function('U', 'B') != NULL;
}

void rom_enter_loader(void)
{
    rom_loader loader = (rom_loader)rom_function('U', 'B');
    if (loader != NULL) {
        loader(0, 0); // reboots; both the drive and PICOBOOT on
    }
    system_reset();
}
