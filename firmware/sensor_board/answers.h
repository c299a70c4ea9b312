// The sensors' answers, ready in the bus's own time: the device model, run ahead of the bus.
#ifndef BIOTAC_SENSOR_BOARD_ANSWERS_H
#define BIOTAC_SENSOR_BOARD_ANSWERS_H

#include "stream.h"

typedef struct {
    uint32_t words;      // read from a sensor alone
    uint32_t late;       // of them, not what the sensor would have said
    uint32_t slowest_us; // from the end of an exchange until its sensor's next answer was ready
    uint32_t first_us;   // when the first sample was asked for, and the latest
    uint32_t latest_us;
} bt_answer_counts;

// stream: where samples come from; it stays.
void answers_start(bt_emu_stream *stream);

// Plug a sensor in, or out. serial: up to 16 characters; empty: one made up.
void answers_plug(uint8_t finger, bool present, const char *serial);

// A new tape, for sensors that remember nothing of the one before.
void answers_forget(void);

// Say it anew: the source says something else from now on.
void answers_renew(void);

bt_answer_counts answers_counts(void);

#endif
