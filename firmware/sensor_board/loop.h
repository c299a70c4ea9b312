// A tape in flash, where a gateway has its wrench maps: played from power-up on, until a host brings another.
#ifndef BIOTAC_SENSOR_BOARD_LOOP_H
#define BIOTAC_SENSOR_BOARD_LOOP_H

#include "stream.h"

// Slots of the tape in flash; 0: there is none that is whole.
uint32_t loop_slots(void);

// Play it; while nobody reads. Nothing is done when there is none.
void loop_play(bt_emu_stream *stream);

// Keep so many slots, or none. Returns an enum bt_error: NOT_WHOLE when the stream has not, or no more, just
// these. The flash is written by loop_poll().
uint8_t loop_keep(const bt_emu_stream *stream, uint32_t slots, uint32_t crc32);

// From the main loop: one sector, if one is to be written.
void loop_poll(void);

#endif
