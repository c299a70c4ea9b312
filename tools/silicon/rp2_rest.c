// Stand-ins for the rest of an image, and the chip's own code, as called by the port's files.
#include "port.h"
#include "registers.h"
#include "rp2_rules.h"
#include "system.h"

#include <stdlib.h>
#include <string.h>

bool host_sends_frames;

#ifdef ON_rp2350
#define uint16_t uintptr_t // the ROM's pointers have 16 bits, this computer's more
#include "rom.c"
#undef uint16_t
#else
uint8_t flash_jedec_id[3];
uint32_t flash_erase_us;

void flash_start(void)
{
}

bool flash_identify(uint8_t id[FLASH_ID_BYTES])
{
    memset(id, 0x11, FLASH_ID_BYTES);
    return true;
}

const uint8_t *flash_maps(void)
{
    return NULL;
}

bool rom_has_loader(void)
{
    return false;
}

void rom_enter_loader(void)
{
    abort();
}
#endif

uint32_t image_crc32(void)
{
    return 0;
}

bool bt_port_alarm(void)
{
    return false;
}

void use_interrupt(int number, uint32_t priority, void (*handler)(void))
{
    (void)priority, (void)handler;
    interrupt_used(number);
}

void wake(void)
{
}

void sleep_until_woken(void)
{
    now_ns += 1000000;
    usb_starts += host_sends_frames;
}
