// Vibration energy of dynamic pressure (PAC), in octaves.
//
// Six smoothers in a row, each binomial (1 4 6 4 1) / 16 and twice as wide as the one before; what a smoother
// removes is a band. Half power is at 11-26, 22-53, 45-106, 91-214, 190-454 and 527-1100 Hz. The first
// smoother sees 2200 samples a second, the others every second sample of its output, which is the same number
// in every round. (The "a trous" wavelet transform with a B-spline: Starck, Murtagh and Bijaoui 1998.)
#ifndef BIOTAC_BANDS_H
#define BIOTAC_BANDS_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

#define BT_BANDS      6
#define BT_BANDS_SLOW (BT_PAC_PER_FRAME / 2) // samples of a round after the first smoother

// For each smoother its past samples, then those of this round; 1/4 count.
typedef struct {
    bool begun;
    uint16_t fast[4 + BT_PAC_PER_FRAME];
    uint16_t slow[4 * (1 + 2 + 4 + 8 + 16) + 5 * BT_BANDS_SLOW];
} bt_bands;

// Energies of a round in 1/16 count^2, lowest band first. Returns how many of its samples are good. The last
// good sample stands in for each missing one (BT_INVALID_COUNT); with no good sample the energies are
// invalid. A bt_bands of all zeros begins as if its first sample had always been there.
uint8_t bt_bands_round(bt_bands *bands, const uint16_t pac[BT_PAC_PER_FRAME], uint32_t energy_q4[BT_BANDS]);

#endif
