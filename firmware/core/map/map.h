// The wrench map: a calibrated finger's force, and torque, as a sum of blocks (SPEC.md, Wrench maps). A block
// is a vector of columns (the kind: signals, their pairs, conductances...) times a scalar (the gate: where
// the contact is), with a coefficient per column and axis. A map is read in place; nothing is copied.
//
// Factors and coefficients have 16 bits, sums 32. No input overflows: bt_map_open bounds every sum by the
// magnitudes of the coefficients. Results saturate at BT_MAP_RESULT_MAX.
#ifndef BIOTAC_MAP_H
#define BIOTAC_MAP_H

#include "map/map_gen.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Half width of the 95 % interval about a force, on frames not used for the fit: a base, and a share of
// normal and shear together (solve/interval.h). First of the normal, then of the shear; base_mn 65535:
// unknown.
typedef struct {
    uint16_t base_mn[2];
    uint16_t share_q8[2];
} bt_margin;

#define BT_MARGIN_SHARE_MAX_Q8 4096

typedef struct {
    uint8_t axes; // BT_MAP_AXES_FORCE, _TORQUE (force too) or _TORSION (all); 0: there is no map
    uint8_t block_count;
    uint16_t kinds;  // bit mask of the blocks' kinds; others are not computed
    uint16_t gates;  // likewise
    uint32_t made_s; // since 1970 UTC; 0: unknown
    bt_margin margin;
    const uint8_t *serial; // [BT_SERIAL_BYTES] of the sensor, in the blob like the rest; all zero: any
    const uint8_t *lesson; // the touches fitted to (lesson.h); NULL: unknown
    const uint8_t *blocks;
    const uint8_t *coefficients;
} bt_map;

// By-products of a map's result: the parts of pairs of signals and of conductances in the force, two gates,
// and how far the compression extends along (lesson.h), in a gate's unit.
typedef struct {
    int32_t pairs_100un[2][3];
    int32_t x, yy, extent;
} bt_map_parts;

// Make this no map, as bt_map_open does on a refusal.
void bt_map_close(bt_map *map);

// Check a blob and point map into it. The blob must be aligned to 4 bytes and stay unchanged in place as long
// as map is used. Returns an enum bt_error: OK, BAD_LENGTH or OUT_OF_RANGE (version, axes, kind, gate,
// exponent, a block twice, coefficients that could overflow, a bad alignment).
uint8_t bt_map_open(bt_map *map, const uint8_t *blob, size_t bytes);

// True if results need PDC.
bool bt_map_needs_pdc(const bt_map *map);

// One frame's results for 3 axes or all of the map's: force in 100 uN, then torque and torsion in mN*mm; and
// parts, unless NULL. e_q4: from bt_signals_q4; the rest as below, but a map that needs PDC must be given it.
void bt_map_results(const bt_map *map, const int32_t e_q4[BT_ELECTRODES],
                    const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                    int32_t pdc_above_rest_q4, int axes, int32_t result[], bt_map_parts *parts);

// One frame's results: force in 100 uN, torque and torsion in mN*mm. counts: 0..4095 or BT_INVALID_COUNT; an
// electrode without a count or a tare has signal 0. pdc_above_rest_q4: BT_INVALID_I32 if unknown; a map that
// needs it then gives BT_INVALID_I32. torque_mnmm, about the centre of the tip sphere, and torsion_mnmm,
// about the outward normal at the contact, are written by a map that has them. torque_mnmm NULL: neither is
// wanted.
void bt_map_wrench(const bt_map *map, const uint16_t counts[BT_ELECTRODES],
                   const uint16_t tare_q4[BT_ELECTRODES], int32_t pdc_above_rest_q4, int32_t force_100un[3],
                   int32_t *torque_mnmm, int32_t *torsion_mnmm);

// The same from the caller's signals, and parts, unless NULL.
void bt_map_wrench_of(const bt_map *map, const int32_t e_q4[BT_ELECTRODES],
                      const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                      int32_t pdc_above_rest_q4, int32_t force_100un[3], int32_t *torque_mnmm,
                      int32_t *torsion_mnmm, bt_map_parts *parts);

#endif
