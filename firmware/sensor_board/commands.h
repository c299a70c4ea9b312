// The host's commands to the board, and the answers: protocol/emu.toml.
#ifndef BIOTAC_SENSOR_BOARD_COMMANDS_H
#define BIOTAC_SENSOR_BOARD_COMMANDS_H

#include "stream.h"

void commands_start(bt_emu_stream *stream);

// Main loop: handle bytes from the host.
void commands_poll(void);

#endif
