// A stream's counts for a bus with a clock of its own: the tape's order counts, not time. Each sample command
// gets the channel's next sample, and all fingers stay in the same slot. With by_time, whole rounds are
// skipped or repeated to follow the clock.
#ifndef BIOTAC_SENSOR_BOARD_IN_ORDER_H
#define BIOTAC_SENSOR_BOARD_IN_ORDER_H

#include "stream.h"

// A bt_emu_source; context is the stream.
uint16_t bt_emu_stream_in_order(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns);

#endif
