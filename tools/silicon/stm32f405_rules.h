#ifndef BIOTAC_SILICON_STM32F405_RULES_H
#define BIOTAC_SILICON_STM32F405_RULES_H

#include <stdbool.h>
#include <stdint.h>

// As out of reset, or as after the ROM loader's Go.
void chip_reset(bool by_loader);
uint32_t hclk_hz(void);          // by the registers as they are
extern uint32_t nvic_enabled[4]; // bit: interrupt
extern uint32_t gpio_c_out;      // bit: pin

#endif
