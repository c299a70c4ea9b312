// A wrench map: coefficients from one frame's signals to force and torque, as a blob that the host made.
#ifndef BIOTAC_MAP_H
#define BIOTAC_MAP_H

#include <stddef.h>
#include <stdint.h>

// Points into the blob, which must stay as it is.
typedef struct {
    const uint8_t *serial; // 16 bytes: of the sensor it was made for; all zero: any sensor
    uint32_t made_s;       // since 1970 UTC; 0: unknown
} bt_map;

// Returns an enum bt_error: OK, or OUT_OF_RANGE for a blob that is no map this firmware can compute.
uint8_t bt_map_open(bt_map *map, const uint8_t *blob, size_t bytes);

#endif
