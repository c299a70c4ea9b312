#include "signal/bands.h"

#include <string.h>

#define LARGEST (4u * BT_FULL_SCALE_COUNT)

_Static_assert(16 * LARGEST + 8 <= UINT32_MAX && LARGEST <= UINT16_MAX,
               "a smoothed sample must fit its type");
// The middle tap weighs 6/16, so at most 10/16 of the range is removed, and one unit by rounding.
_Static_assert((uint64_t)BT_PAC_PER_FRAME *(LARGEST * 10 / 16 + 1) * (LARGEST * 10 / 16 + 1) < UINT32_MAX,
               "a round's energy must fit its type, below the mark for none");
_Static_assert(BT_PAC_PER_FRAME % 2 == 0, "each round must have the same number of slow samples");
_Static_assert(sizeof((bt_msg_bands *)0)->energy_q4 == BT_BANDS * sizeof(uint32_t), "one field per band");

// Smooth the n samples from line[4 * apart] on into out, and shift the line by n. Returns the energy removed.
static uint32_t smooth(uint16_t *line, unsigned apart, unsigned n, uint16_t *out)
{
    uint32_t energy = 0;
    for (unsigned k = 0; k < n; k++) {
        const uint16_t *tap = line + k;
        const uint32_t middle = tap[2 * apart];
        const uint32_t sides = (uint32_t)tap[apart] + tap[3 * apart];
        const uint32_t left = (tap[0] + 4 * sides + 6 * middle + tap[4 * apart] + 8) >> 4;
        const int32_t removed = (int32_t)(middle - left);
        energy += (uint32_t)(removed * removed);
        out[k] = (uint16_t)left;
    }
    for (unsigned k = 0; k < 4 * apart; k++) {
        line[k] = line[k + n];
    }
    return energy;
}

static void fill(uint16_t *line, size_t n, uint16_t with)
{
    for (size_t k = 0; k < n; k++) {
        line[k] = with;
    }
}

static void begin(bt_bands *bands, uint16_t sample)
{
    bands->begun = true;
    fill(bands->fast, sizeof bands->fast / sizeof *bands->fast, sample);
    fill(bands->slow, sizeof bands->slow / sizeof *bands->slow, sample);
}

static uint8_t load_samples(bt_bands *bands, const uint16_t pac[BT_PAC_PER_FRAME])
{
    uint8_t good = 0;
    for (unsigned k = 0; k < BT_PAC_PER_FRAME; k++) {
        uint16_t sample = bands->fast[3 + k];
        if (pac[k] != BT_INVALID_COUNT) {
            sample = (uint16_t)(4 * pac[k]);
            good++;
            if (!bands->begun) {
                begin(bands, sample);
            }
        }
        bands->fast[4 + k] = sample;
    }
    return good;
}

uint8_t bt_bands_round(bt_bands *bands, const uint16_t pac[BT_PAC_PER_FRAME], uint32_t energy_q4[BT_BANDS])
{
    uint16_t left[BT_PAC_PER_FRAME];
    const uint8_t good = load_samples(bands, pac);
    energy_q4[BT_BANDS - 1] = smooth(bands->fast, 1, BT_PAC_PER_FRAME, left);
    uint16_t *line = bands->slow;
    for (unsigned k = 0; k < BT_BANDS_SLOW; k++) {
        line[4 + k] = left[2 * k + 1];
    }
    unsigned apart = 1;
    for (int band = BT_BANDS - 2; band >= 0; band--) {
        uint16_t *next = line + 4 * apart + BT_BANDS_SLOW;
        // Each slow sample stands for two.
        energy_q4[band] = 2 * smooth(line, apart, BT_BANDS_SLOW, band > 0 ? next + 8 * apart : left);
        line = next;
        apart *= 2;
    }
    if (good == 0) {
        memset(energy_q4, 0xFF, BT_BANDS * sizeof *energy_q4);
    }
    return good;
}
