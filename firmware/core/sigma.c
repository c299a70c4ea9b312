#include "sigma.h"

#include "fix.h"

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

static uint16_t poc_sigma_um(const int32_t e_q4[BT_ELECTRODES], int weights, const int16_t poc_um[3],
                             uint32_t sigma_q8)
{
    uint64_t spread = 0; // of w'^2 |r - c|^2
    uint64_t total = 0;  // W
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (e_q4[i] == 0 || (e_q4[i] > 0 && weights != BT_POC_WEIGHTS_ABS_N2)) {
            continue;
        }
        uint32_t e = (bt_abs32(e_q4[i]) + 8) >> 4;
        uint32_t slope = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? 1 : 2 * e;
        total += weights == BT_POC_WEIGHTS_COMPRESS_N1 ? e : e * e;
        uint32_t squared_um = 0; // each distance is below 2^15.2, three squares below 2^32
        for (int d = 0; d < 3; d++) {
            int32_t away = bt_electrode_um[i][d] - poc_um[d];
            squared_um += (uint32_t)(away * away);
        }
        spread += (uint64_t)(slope * slope) * squared_um;
    }
    return total == 0 ? UNKNOWN : saturate((root(spread) * sigma_q8 / total + 128) >> 8);
}

void bt_sigma(const int32_t e_q4[BT_ELECTRODES], const bt_kernel_settings *settings, uint32_t noise_count2,
              bt_msg_frame *msg)
{
    if (noise_count2 == 0) {
        return; // not measured yet
    }
    uint32_t sigma_q8 = bt_sigma_count_q8(noise_count2);
    if (msg->poc_um[0] != BT_INVALID_I16) {
        msg->poc_sigma_um = poc_sigma_um(e_q4, settings->poc_weights, msg->poc_um, sigma_q8);
    }
    if (msg->force_100un[0] != BT_INVALID_I32) {
        for (int d = 0; d < 3; d++) {
            uint64_t sigma = (uint64_t)settings->force_per_count_100un_q16[d] * sigma_q8;
            msg->force_sigma_100un[d] = saturate((sigma + (1 << 23)) >> 24);
        }
    }
}
