// Stand-ins for the rest of an image, as called by the port's files.
#include "cortex_m.h"
#include "registers.h"
#include "stm32f405_rules.h"

#include <stdlib.h>

extern uint32_t image_stack_top[1];
uint32_t image_stack_top[1];
void image_reset(void);

void image_reset(void)
{
}

uint32_t image_crc32(void)
{
    return 0;
}

void use_interrupt(int number, uint32_t priority, void (*handler)(void))
{
    (void)number, (void)priority, (void)handler;
}

void systick_alarm_start(uint32_t core_hz)
{
    if (core_hz != hclk_hz()) {
        abort();
    }
}

void wake(void)
{
}

void sleep_until_woken(void)
{
    now_ns += 1000000;
}
