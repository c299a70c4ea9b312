// The RP2040 asks nothing that rp2_rules.c does not know.
#include "rp2_own.h"

void own_reset(void)
{
}

bool own_knows(uint32_t at)
{
    return at >= 0x40060000u && at < 0x40064000u; // ROSC
}

void own_read(uint32_t at)
{
    (void)at;
}

void own_write(uint32_t at, uint32_t old, uint32_t value)
{
    (void)at, (void)old, (void)value;
}
