#include "map/population.h"

#include "fixed_point.h"
#include "map/conductance.h"
#include "map/map_gen.h"
#include "map/population_gen.h"

#include <stdbool.h>

const uint16_t bt_population_sigma_100un[3] = BT_POPULATION_SIGMA_100UN;

// ---- bounds --------------------------------------------------------------------------------------------

#define SIGNAL_MAX ((int64_t)BT_FULL_SCALE_COUNT << BT_POPULATION_SIGNAL_Q)
#define GATED_MAX  (BT_POPULATION_SIGNAL_SUM_MAX * SIGNAL_MAX)
#define FACTOR_MAX ((int64_t)BT_MAP_RATIO_MAX << BT_POPULATION_CONDUCTANCE_Q)
#define HALF(bits) ((int32_t)1 << ((bits) - 1))

_Static_assert(GATED_MAX + HALF(BT_POPULATION_GATED_SHIFT) <= INT32_MAX, "a gate's sum must fit int32");
_Static_assert(((GATED_MAX >> BT_POPULATION_GATED_SHIFT) + 1) * BT_POPULATION_GATE_MAX <= INT32_MAX,
               "a gate's sum times its gate must fit int32");
_Static_assert(BT_POPULATION_ROW_SUM_MAX *FACTOR_MAX + HALF(BT_POPULATION_ROW_SHIFT) <= INT32_MAX,
               "a row must fit int32");
_Static_assert(((BT_POPULATION_ROWS_MAX >> BT_POPULATION_ROW_SHIFT) + BT_ELECTRODES) * FACTOR_MAX
                   <= INT32_MAX,
               "the rows' sum must fit int32");

// ---- what it is linear in ------------------------------------------------------------------------------

// num < 3 den and den < 2^28 + 2^12: a divisor of 16 bits is off by 2^-15, a unit at most.
_Static_assert(BT_MAP_RATIO_MAX == 3 && BT_POPULATION_CONDUCTANCE_Q == 13, "6 * 2^28 must fit 32 bits");

static int32_t conductance(uint16_t count, uint16_t tare_q4)
{
    bt_conductance its = bt_conductance_of(count, tare_q4);
    uint32_t num = its.num, den = its.den;
    if (num >= BT_MAP_RATIO_MAX * den) {
        return (int32_t)FACTOR_MAX; // a loss of conductance is never more than all of it
    }
    while (den < 1u << 27) {
        den <<= 1;
        num <<= 1;
    }
    uint32_t divisor = (den + (1u << 11)) >> 12;
    uint32_t u = BT_DIVIDE_U32(2 * num + divisor / 2, divisor);
    return bt_with_sign(u < FACTOR_MAX ? u : (uint32_t)FACTOR_MAX, its.e_q4);
}

_Static_assert((int64_t)BT_ELECTRODES *(BT_FULL_SCALE_COUNT + BT_MAP_FLOOR_Q4 / 16 + 1) * BT_ELECTRODE_MAX_UM
                   <= INT32_MAX,
               "a moment of whole counts must fit int32");

// The compression's centroid over its reaches: the gates x and y.
static void gates_of(const int32_t e_q4[BT_ELECTRODES], int32_t gate[2])
{
    static const int32_t reach_um[2] = {BT_MAP_REACH_X_UM, BT_MAP_REACH_Y_UM};
    int32_t moment[2] = {0, 0};
    int32_t weight = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t w = BT_MAP_FLOOR_Q4 / 16;
        w += e_q4[i] < 0 ? (8 - e_q4[i]) >> 4 : 0;
        weight += w;
        moment[0] += w * bt_electrode_um[i][0];
        moment[1] += w * bt_electrode_um[i][1];
    }
    for (int d = 0; d < 2; d++) {
        uint32_t um = bt_div_round_u32(bt_abs32(moment[d]), (uint32_t)weight);
        uint32_t ratio = bt_div_round_u32(um << BT_POPULATION_GATE_Q, (uint32_t)reach_um[d]);
        gate[d] = bt_with_sign(ratio < BT_POPULATION_GATE_MAX ? ratio : BT_POPULATION_GATE_MAX, moment[d]);
    }
}
_Static_assert((int64_t)BT_ELECTRODE_MAX_UM << BT_POPULATION_GATE_Q < 1ll << 31, "a coordinate must fit");

// ---- sums ----------------------------------------------------------------------------------------------

#define OF_GATE (2 * BT_ELECTRODES)

static int32_t rounded(int32_t value, int bits)
{
    return bt_shift_down(value + HALF(bits), bits);
}

// One gate's sum. Called, not inlined: then three sums and three coefficients stay in registers.
static BT_NOINLINE void gated_sum(const int32_t e[BT_ELECTRODES], const int16_t (*c)[3], int32_t sum[3])
{
    int32_t x = 0, y = 0, z = 0;
    for (int i = 0; i < BT_ELECTRODES; i++, c++) {
        const int16_t *its = e[i] > 0 ? c[BT_ELECTRODES] : *c;
        x += e[i] * its[0];
        y += e[i] * its[1];
        z += e[i] * its[2];
    }
    sum[0] = x;
    sum[1] = y;
    sum[2] = z;
}

// By counts, in 2^-(SIGNAL_EXPONENT + GATE_Q - GATED_SHIFT).
static void add_signals(const int32_t e_q4[BT_ELECTRODES], int32_t force_100un[3])
{
    enum { BITS = BT_POPULATION_SIGNAL_EXPONENT + BT_POPULATION_GATE_Q - BT_POPULATION_GATED_SHIFT };
    int32_t gate[2], sum[3], e[BT_ELECTRODES];
    gates_of(e_q4, gate);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = bt_shift_down(e_q4[i] + 2, 4 - BT_POPULATION_SIGNAL_Q);
    }
    gated_sum(e, bt_population_signal, sum);
    for (int d = 0; d < 3; d++) {
        force_100un[d] = rounded(sum[d], BT_POPULATION_SIGNAL_EXPONENT);
    }
    for (int g = 0; g < 2; g++) {
        gated_sum(e, bt_population_signal + (g + 1) * OF_GATE, sum);
        for (int d = 0; d < 3; d++) {
            force_100un[d] += rounded(rounded(sum[d], BT_POPULATION_GATED_SHIFT) * gate[g], BITS);
        }
    }
}

// From the electrode's own coefficient on; returns what is behind the row.
static BT_NOINLINE const int16_t (*row_sum(const int32_t u[BT_ELECTRODES], int from, const int16_t (*c)[3],
                                           int32_t sum[3]))[3]
{
    int32_t x = (*c)[0] * (1 << BT_POPULATION_CONDUCTANCE_Q);
    int32_t y = (*c)[1] * (1 << BT_POPULATION_CONDUCTANCE_Q);
    int32_t z = (*c)[2] * (1 << BT_POPULATION_CONDUCTANCE_Q);
    const int32_t *end = u + BT_ELECTRODES;
    for (u += from, c++; u != end; u++, c++) {
        int32_t factor = *u;
        x += factor * (*c)[0];
        y += factor * (*c)[1];
        z += factor * (*c)[2];
    }
    sum[0] = x;
    sum[1] = y;
    sum[2] = z;
    return c;
}

// By conductances, each row's sum before it meets its first factor.
static void add_conductances(const int32_t u[BT_ELECTRODES], int32_t force_100un[3])
{
    const int16_t (*c)[3] = bt_population_conductance;
    int32_t total[3] = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t row[3];
        c = row_sum(u, i, c, row);
        total[0] += rounded(row[0], BT_POPULATION_ROW_SHIFT) * u[i];
        total[1] += rounded(row[1], BT_POPULATION_ROW_SHIFT) * u[i];
        total[2] += rounded(row[2], BT_POPULATION_ROW_SHIFT) * u[i];
    }
    for (int d = 0; d < 3; d++) {
        int32_t bits =
            BT_POPULATION_CONDUCTANCE_EXPONENT + BT_POPULATION_CONDUCTANCE_Q - BT_POPULATION_ROW_SHIFT;
        force_100un[d] += rounded(total[d], bits);
    }
}

void bt_population_force(const int32_t e_q4[BT_ELECTRODES], const uint16_t counts[BT_ELECTRODES],
                         const uint16_t tare_q4[BT_ELECTRODES], int32_t force_100un[3])
{
    int32_t u[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        bool known = counts[i] != BT_INVALID_COUNT && tare_q4[i] != BT_INVALID_COUNT;
        u[i] = known ? conductance(counts[i], tare_q4[i]) : 0;
    }
    add_signals(e_q4, force_100un);
    add_conductances(u, force_100un);
}

// ---- is it a frame like those it was learnt from --------------------------------------------------------

#define NOISE_Q4    (8 * 16) // of an electrode: it is no part of the pattern
#define SPREAD_BITS 11       // of |e|, so that the square of their sum fits

_Static_assert((uint64_t)BT_ELECTRODES *BT_ELECTRODES << 2 * SPREAD_BITS <= UINT32_MAX, "a square must fit");
_Static_assert(9ull * BT_ELECTRODES << 2 * SPREAD_BITS <= UINT32_MAX, "nine energies must fit");

static uint32_t beyond_noise(int32_t e_q4)
{
    uint32_t size = bt_abs32(e_q4);
    return size > NOISE_Q4 ? size - NOISE_Q4 : 0;
}

uint32_t bt_population_share(const int32_t e_q4[BT_ELECTRODES])
{
    uint32_t every = 0, sum = 0, energy = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        every |= beyond_noise(e_q4[i]);
    }
    int shift = bt_bit_length(every) > SPREAD_BITS ? bt_bit_length(every) - SPREAD_BITS : 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t e = beyond_noise(e_q4[i]) >> shift;
        sum += e;
        energy += e * e;
    }
    uint32_t square = sum * sum;
    if (square / 2 >= 9 * energy / 4 && square != 0) {
        return BT_POPULATION_ALL;
    }
    if (square <= 3 * energy) {
        return 0;
    }
    // at most 1.5 energies over 1.5 energies, in 1/256; energy is at least 2^20, or all are small
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
