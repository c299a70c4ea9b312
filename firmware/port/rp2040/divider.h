// The RP2040's hardware divider (data sheet 2.3.1.5), for BT_DIVIDE_U32: eight cycles, and the same
// quotient as the C operator. Not for interrupt handlers: they would disturb a division under way.
#ifndef BIOTAC_RP2040_DIVIDER_H
#define BIOTAC_RP2040_DIVIDER_H

#include <stdint.h>

static inline uint32_t rp2040_divide(uint32_t num, uint32_t den)
{
    volatile uint32_t *sio = (volatile uint32_t *)0xD0000000u;
    sio[0x60 / 4] = num; // DIV_UDIVIDEND
    sio[0x64 / 4] = den; // DIV_UDIVISOR, starts it
    __asm volatile("b 1f\n1: b 1f\n1: b 1f\n1: b 1f\n1:");
    return sio[0x70 / 4]; // DIV_QUOTIENT
}

#define BT_DIVIDE_U32(num, den) rp2040_divide(num, den)

#endif
