#ifndef BIOTAC_SILICON_RP2_RULES_H
#define BIOTAC_SILICON_RP2_RULES_H

#include <stdbool.h>
#include <stdint.h>

void chip_reset(void);                  // as after the boot ROM
extern uint32_t gpio_in, gpio_out;      // the pins' levels: driven from outside, and by SIO's outputs
extern bool host_sends_frames;          // on USB, one a millisecond
extern uint32_t usb_resets;             // how often the USB's block was put into reset
extern bool dma_is_late;                // the slot's words have not all come when the core looks
extern uint32_t heard[64], words_heard; // words on the bus: for each, the pins that were low
extern char rom_calls[64];              // of an RP2350's flash functions, a letter each
extern uint32_t sck_khz, word_bits;     // of the latest word on the bus, by the registers
uint32_t uart_bits_per_s(void);         // likewise; 0 while it is off, or has no pins
void interrupt_used(int number);

#endif
