// What the port's files call of the rest of an image, and of the chip's own code.
#include "port.h"
#include "registers.h"
#include "rp2040_rules.h"
#include "system.h"

#include <stdlib.h>
#include <string.h>

uint8_t flash_jedec_id[3];
uint32_t flash_erase_us;
bool host_sends_frames;

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
    (void)number, (void)priority, (void)handler;
}

void wake(void)
{
}

void sleep_until_woken(void)
{
    now_ns += 1000000;
    usb_starts += host_sends_frames;
}
