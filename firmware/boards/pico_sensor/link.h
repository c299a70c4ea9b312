// What the host says to the board, and what it is told: protocol/link.toml, from 0x40 and 0xC0 on.
#ifndef BIOTAC_PICO_SENSOR_LINK_H
#define BIOTAC_PICO_SENSOR_LINK_H

#include "stream.h"

void link_start(bt_emu_stream *stream);

// Main loop: what came from the host.
void link_poll(void);

#endif
