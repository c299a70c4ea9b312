// The sensors' answers in time for the bus: the device model, run ahead of it.
#ifndef BIOTAC_SENSOR_BOARD_ANSWERS_H
#define BIOTAC_SENSOR_BOARD_ANSWERS_H

#include "stream.h"

typedef struct {
    uint32_t words;      // read from a sensor alone
    uint32_t late;       // of these, other words than the sensor's
    uint32_t slowest_us; // from the end of an exchange to the sensor's next answer
    uint32_t first_us;   // time of the first sample command, and of the latest
    uint32_t latest_us;
} bt_answer_counts;

// stream: the source of samples; must outlive the sensors.
void answers_start(bt_emu_stream *stream);

// Plug a sensor in, or out. serial: up to 16 characters; empty: a made-up one.
void answers_plug(uint8_t finger, bool present, const char *serial);

// A new tape, for sensors without a memory of the earlier one.
void answers_forget(void);

// Renew the answers: the source has changed.
void answers_renew(void);

bt_answer_counts answers_counts(void);

#endif
