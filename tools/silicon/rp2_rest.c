// What the port's files call of the rest of an image, and of the chip's own code.
#include "port.h"
#include "registers.h"
#include "rp2_rules.h"
#include "system.h"

#include <stdlib.h>
#include <string.h>

bool host_sends_frames;

#ifdef ON_rp2350
// The ROM's flash calls, in their order: a letter each.
char rom_calls[64];

static void called(char which)
{
    const size_t used = strlen(rom_calls);
    if (used + 1 < sizeof rom_calls) {
        rom_calls[used] = which;
        rom_calls[used + 1] = '\0';
    }
}

#define CALL(letter)                                                                                         \
    static void call_##letter(void)                                                                          \
    {                                                                                                        \
        called(#letter[0]);                                                                                  \
    }
CALL(I)
CALL(E)
CALL(F)
CALL(C)
CALL(R)
CALL(P)

void *rom_function(char first, char second)
{
    static void (*const call[])(void) = {call_I, call_E, call_F, call_C, call_R, call_P};
    static const char name[] = "IFEXFCCXRERP";
    for (int k = 0; k < 6; k++) {
        if (name[2 * k] == first && name[2 * k + 1] == second) {
            return (void *)(uintptr_t)call[k];
        }
    }
    return NULL;
}
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
#endif

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
