#include "signal/noise.h"

#include "fixed_point.h"
#include "signal/sweep.h"

// White noise on 19 electrodes exceeds the threshold once in 10^5 rounds, never three times in a row.
#define THRESHOLD_TO_NOISE 3
#define MEAN_SWEEPS        16

_Static_assert(BT_SETTING_CONTACT_ENERGY_COUNT2_MAX <= INT32_MAX >> 8, "the noise in q8 must fit 31 bits");
_Static_assert(BT_SETTING_CONTACT_ENERGY_COUNT2_MAX *(int64_t)THRESHOLD_TO_NOISE < BT_TRIGGER_NEVER,
               "a threshold must be a valid limit");

void bt_noise_add(bt_noise *noise, uint32_t deviation_q6, uint32_t setting_count2)
{
    // A count is an eighth of the mean, so the distance from the mean has 7/8 of the noise's energy. The
    // sample is capped at the setting: a slowly growing vibration must not raise the threshold ahead of
    // itself for ever. The threshold thus never exceeds THRESHOLD_TO_NOISE times the setting.
    uint32_t cap_q8 = setting_count2 << 8;
    uint32_t sample_q8 = cap_q8;
    if (deviation_q6 < cap_q8 >> 2) {
        sample_q8 = 4 * deviation_q6 + bt_div_round_u32(4 * deviation_q6, BT_SWEEP_ROUNDS - 1);
        sample_q8 = sample_q8 < cap_q8 ? sample_q8 : cap_q8;
    }
    noise->sweeps = bt_count_up(noise->sweeps, MEAN_SWEEPS); // a plain mean first, which is unbiased
    int32_t change_q8 = (int32_t)(sample_q8 - noise->mean_q8);
    uint32_t step_q8 = bt_div_round_u32(bt_abs32(change_q8), noise->sweeps);
    noise->mean_q8 += (uint32_t)bt_with_sign(step_q8, change_q8);
    noise->count2 = (noise->mean_q8 + (1 << 7)) >> 8;
    noise->sigma_q4 = bt_root_u32(noise->mean_q8 / BT_ELECTRODES);
}

uint32_t bt_noise_threshold(const bt_noise *noise, uint32_t setting_count2)
{
    uint32_t raised = noise->count2 * THRESHOLD_TO_NOISE;
    return raised > setting_count2 ? raised : setting_count2;
}
