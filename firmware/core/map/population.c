#include "map/population.h"

#include "fixed_point.h"
#include "map/population_gen.h"

const uint16_t bt_population_sigma_100un[3] = BT_POPULATION_SIGMA_100UN;

// As bt_map_open would fill it in (tests/core/map/test_population.c): the map is checked when it is built.
#define BLOCKS_AT ((const uint8_t *)bt_population_blob + BT_MAP_HEADER_BYTES)
const bt_map bt_population = {
    .axes = BT_MAP_AXES_FORCE,
    .block_count = BT_POPULATION_BLOCKS,
    .kinds = BT_POPULATION_KINDS,
    .gates = BT_POPULATION_GATES,
    .serial = (const uint8_t *)bt_population_blob + 4,
    .blocks = BLOCKS_AT,
    .coefficients = BLOCKS_AT + BT_POPULATION_BLOCKS * BT_MAP_BLOCK_BYTES,
};

void bt_population_force(const int32_t e_q4[BT_ELECTRODES], const uint16_t counts[BT_ELECTRODES],
                         const uint16_t tare_q4[BT_ELECTRODES], int32_t force_100un[3])
{
    bt_map_results(&bt_population, e_q4, counts, tare_q4, 0, BT_MAP_AXES_FORCE, force_100un);
}

// ---- is the frame like those that the map was trained on ------------------------------------------------

#define NOISE_Q4 (8 * 16) // per electrode: not part of the pattern
#define MOST     ((BT_E_MAX_Q4 - NOISE_Q4) >> 3)
#define SUM_BITS 15 // so that 3 energies fit, and 8 times what exceeds them

_Static_assert((int64_t)BT_ELECTRODES * MOST * MOST <= UINT32_MAX, "energies must fit");
_Static_assert(12ll * MOST << SUM_BITS <= UINT32_MAX,
               "8 times 1.5 energies must fit: an energy is below sum * size");

uint32_t bt_population_share(const int32_t e_q4[BT_ELECTRODES])
{
    uint32_t sum = 0, energy = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t size = bt_abs32(e_q4[i]);
        if (size > NOISE_Q4) {
            size = (size - NOISE_Q4) >> 3; // half counts
            sum += size;
            energy += size * size;
        }
    }
    for (; sum >= 1u << SUM_BITS; sum >>= 1) {
        energy >>= 2;
    }
    uint32_t square = sum * sum;
    if (square / 2 >= 9 * energy / 4 && square != 0) {
        return BT_POPULATION_ALL;
    }
    if (square <= 3 * energy) {
        return 0;
    }
    // over / (1.5 energy) in 1/256, where over <= 1.5 energy; energy is at least 2^20, or all are small
    uint32_t over = square - 3 * energy;
    uint32_t share = bt_div_round_u32(over << 3, (3 * energy + 63) >> 6);
    return share < BT_POPULATION_ALL ? share : BT_POPULATION_ALL;
}

void bt_population_mix(uint32_t share, const int32_t lin_100un[3], int32_t force_100un[3])
{
    for (int d = 0; d < 3; d++) {
        int64_t sum = (int64_t)force_100un[d] * (int32_t)share
                      + (int64_t)lin_100un[d] * (int32_t)(BT_POPULATION_ALL - share);
        force_100un[d] = (int32_t)bt_shift_round(sum, 8);
    }
}
