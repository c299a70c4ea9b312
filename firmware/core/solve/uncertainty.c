#include "solve/uncertainty.h"

#include "fixed_point.h"

#include <stdbool.h>

#define VARIANCE_PER_NOISE_Q16 (65536u / BT_ELECTRODES)

#define UNKNOWN BT_INVALID_COUNT
#define TOP     (UNKNOWN - 1u)

static uint16_t saturate(uint64_t value)
{
    return (uint16_t)(value > TOP ? TOP : value);
}

// The largest r with r * r <= n, a bit at a time: only asked for with SIGMA.
static uint64_t root(uint64_t n)
{
    uint64_t r = 0;
    for (uint64_t bit = 1ull << 62; bit != 0; bit >>= 2) {
        uint64_t trial = r + bit;
        r >>= 1;
        if (n >= trial) {
            n -= trial;
            r += bit;
        }
    }
    return r;
}

uint32_t bt_sigma_count_q8(uint32_t noise_count2)
{
    return (uint32_t)root((uint64_t)noise_count2 * VARIANCE_PER_NOISE_Q16);
}

static uint32_t square_of(int32_t value)
{
    return bt_abs32(value) * bt_abs32(value);
}

// num / den in 1/256 um, cut where it saturates anyway.
static uint64_t quotient_q8(uint64_t num, uint64_t den)
{
    uint64_t top = 2ull * UNKNOWN << 8;
    return num / den < top ? num / den : top;
}

static uint16_t poc_sigma_um(const int32_t e_q4[BT_ELECTRODES], int weights, const int16_t poc_um[3],
                             uint32_t sigma_q8)
{
    bool tip = poc_um[0] > 0;
    uint64_t along = 0;  // of w'^2 (x - c_x)^2, on the cylinder
    uint64_t across = 0; // of w'^2 |r x n|^2; on the cylinder without x
    uint64_t total = 0;  // W
    int64_t lever = 0;   // of w r n
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (e_q4[i] == 0 || (e_q4[i] > 0 && weights != BT_POC_WEIGHTS_ABS_N2)) {
            continue;
        }
        uint32_t e = (bt_abs32(e_q4[i]) + 8) >> 4;
        uint32_t weight = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? e : e * e;
        uint32_t slope = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? 1 : 2 * e;
        uint64_t slope2 = slope * slope;
        const int16_t *r = bt_electrode_um[i];
        int32_t out = r[1] * poc_um[1] + r[2] * poc_um[2]; // each product is below 2^28
        uint32_t length2 = square_of(r[1]) + square_of(r[2]);
        if (tip) {
            out += r[0] * poc_um[0];
            length2 += square_of(r[0]);
        } else {
            along += slope2 * square_of(r[0] - poc_um[0]);
        }
        out /= BT_CORE_RADIUS_UM;
        uint32_t out2 = square_of(out); // with c rounded it may be more than the length
        across += slope2 * (length2 > out2 ? length2 - out2 : 0);
        total += weight;
        lever += (int64_t)weight * out;
    }
    if (lever <= 0) { // nothing weighs, or too little to say where
        return UNKNOWN;
    }
    uint64_t along_q8 = quotient_q8(root(along) * sigma_q8, total);
    uint64_t across_q8 = quotient_q8(root(across) * sigma_q8 * BT_CORE_RADIUS_UM, (uint64_t)lever);
    return saturate((root(along_q8 * along_q8 + across_q8 * across_q8) + 128) >> 8);
}

void bt_sigma(const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings, uint32_t noise_count2,
              bt_msg_frame *msg)
{
    if (noise_count2 == 0) {
        return; // not measured yet
    }
    uint32_t sigma_q8 = bt_sigma_count_q8(noise_count2);
    if (msg->poc_um[0] != BT_INVALID_I16) {
        msg->poc_sigma_um = poc_sigma_um(e_q4, settings->poc_weights, msg->poc_um, sigma_q8);
    }
    if (msg->force_100un[0] != BT_INVALID_I32
        && settings->map == NULL) { // a map's depends on where it is touched
        for (int d = 0; d < 3; d++) {
            uint64_t sigma = (uint64_t)settings->force_per_count_100un_q16[d] * sigma_q8;
            msg->force_sigma_100un[d] = saturate((sigma + (1 << 23)) >> 24);
        }
    }
}
