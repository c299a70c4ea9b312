// How strongly dynamic pressure (PAC) vibrates, in octaves.
//
// Six smoothers one behind the other, each binomial (1 4 6 4 1) / 16 and of twice the span of the one before:
// what one takes away is a band. Half power is at 11-26, 22-53, 45-106, 91-214, 190-454 and 527-1100 Hz. The
// first sees 2200 samples a second, the others every second one of what it leaves: as many in every round.
// (The wavelet transform "a trous" with a B-spline: Starck, Murtagh and Bijaoui 1998.)
#ifndef BIOTAC_BANDS_H
#define BIOTAC_BANDS_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

#define BT_BANDS      6
#define BT_BANDS_SLOW (BT_PAC_PER_FRAME / 2) // samples of a round behind the first smoother

// Each smoother's past and then its samples of a round, 1/4 count.
typedef struct {
    bool begun;
    uint16_t fast[4 + BT_PAC_PER_FRAME];
    uint16_t slow[4 * (1 + 2 + 4 + 8 + 16) + 5 * BT_BANDS_SLOW];
} bt_bands;

// Energies of a round, 1/16 count^2, the lowest band first; returns how many of its samples are good. For
// each that is missing (BT_INVALID_COUNT) stands the last good one; of none no energy is valid. All zero, it
// begins as if the first sample had been there always.
uint8_t bt_bands_round(bt_bands *bands, const uint16_t pac[BT_PAC_PER_FRAME], uint32_t energy_q4[BT_BANDS]);

#endif
