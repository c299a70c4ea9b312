#ifndef BIOTAC_SILICON_RP2040_RULES_H
#define BIOTAC_SILICON_RP2040_RULES_H

#include <stdbool.h>
#include <stdint.h>

void chip_reset(void);             // as its boot ROM leaves it
extern uint32_t gpio_in, gpio_out; // the pins' levels: driven from outside, and by SIO's outputs
extern bool host_sends_frames;     // on USB, one a millisecond
extern uint32_t usb_resets;        // how often the USB's block was put into reset

#endif
