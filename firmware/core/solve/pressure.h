// Force from static pressure (PDC), Navarro et al. 2015 Eq 1 and 3: a single-pole filter over every round's
// word, and a gain on its rise above rest.
//
// Rest (P0) is the tare machine's. Pressure at rest drifts with temperature, fluid and air, by counts worth
// newtons within minutes, so a P0 stored with the gain would be wrong the next day. The tare machine follows
// it while nothing touches and freezes it on contact, as it does for the electrodes.
//
// The filter runs in every round, asked for or not, so that what is sent does not depend on what was skipped.
// A missing or railed word ends it, and the next good one restarts it as Eq 3's first: an old pressure is
// never passed off as a new one.
//
// Units: counts in 1/256 internally (q8), 1/16 as published (q4); gain nN per count; force 100 uN. All
// rounding is half away from zero. Nothing overflows (assertions in pressure.c).
#ifndef BIOTAC_PRESSURE_H
#define BIOTAC_PRESSURE_H

#include "keep/settings.h"
#include "map/map.h"
#include "wire/messages_gen.h"

#include <stdbool.h>
#include <stdint.h>

// Touches like a map's lesson, added up over FRAMEs: pressure in counts, and the map's normal force.
typedef struct {
    uint32_t pressed;
    uint32_t felt; // in 8 mN
} bt_pressure_learned;

typedef struct {
    int32_t gain_nn;      // 0: not calibrated
    int32_t filter_milli; // weight of a new word
    bool known;           // the latest round had a good word
    int32_t filtered_q8;
    bt_pressure_learned learned;
} bt_pressure;

// Take gain and filter from these settings; the filter keeps its state.
void bt_pressure_use(bt_pressure *pressure, const bt_settings *settings);

// A round's PDC word, 0..4095 or BT_INVALID_COUNT.
void bt_pressure_add(bt_pressure *pressure, uint16_t pdc);

// As published: 1/16 count, BT_INVALID_COUNT when the round had no good word.
uint16_t bt_pressure_filtered_q4(const bt_pressure *pressure);

// Eq 1 on the published values, in 100 uN. BT_INVALID_I32 when either is BT_INVALID_COUNT, or without a gain.
// The host runs recorded frames through this same function.
int32_t bt_pressure_force(uint16_t filtered_q4, uint16_t tare_q4, int32_t gain_nn);

// Pressure as the witness of a map's normal force, once a FRAME is filled in. How much of it a newton makes
// is learned from touches like the lesson, beginning with the counts that the lesson says, 0: unknown. Then
// the interval widens where pressure and force part. Between electrodes a narrow tip looks like a plate that
// presses half as hard, but not to pressure.
void bt_pressure_witness(bt_pressure_learned *learned, const bt_map *map, bt_msg_frame *msg);

#endif
