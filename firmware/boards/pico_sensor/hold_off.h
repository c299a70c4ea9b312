// All interrupts held off, for the few cycles in which two of them must see the same.
#ifndef BIOTAC_PICO_SENSOR_HOLD_OFF_H
#define BIOTAC_PICO_SENSOR_HOLD_OFF_H

#include <stdint.h>

static inline uint32_t hold_off(void)
{
    uint32_t primask;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(primask)::"memory");
    return primask;
}

static inline void go_on(uint32_t primask)
{
    __asm volatile("msr primask, %0" ::"r"(primask) : "memory");
}

#endif
