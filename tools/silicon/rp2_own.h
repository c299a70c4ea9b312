// Parts of rp2_rules.c that each chip's rules define.
#ifndef BIOTAC_SILICON_RP2_OWN_H
#define BIOTAC_SILICON_RP2_OWN_H

#include <stdbool.h>
#include <stdint.h>

void own_reset(void);
bool own_knows(uint32_t at); // a block that only this chip has, or has elsewhere
void own_read(uint32_t at);
void own_write(uint32_t at, uint32_t old, uint32_t value);

#endif
