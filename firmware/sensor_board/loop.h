// A tape in flash, in place of a gateway's wrench maps: played from power-up on, until a host sends another.
#ifndef BIOTAC_SENSOR_BOARD_LOOP_H
#define BIOTAC_SENSOR_BOARD_LOOP_H

#include "stream.h"

// Slots of the whole tape in flash; 0: none.
uint32_t loop_slots(void);

// Play it, without a reader. No effect without a tape.
void loop_play(bt_emu_stream *stream);

// Store so many slots, or none. Returns an enum bt_error: NOT_WHOLE unless the stream still has exactly
// these. loop_poll() writes the flash.
uint8_t loop_store(const bt_emu_stream *stream, uint32_t slots, uint32_t crc32);

// Main loop: write one sector, if one is due.
void loop_poll(void);

#endif
