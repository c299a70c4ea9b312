// The noise of a resting finger, and the threshold above it, so that noise is no touch.
//
// Units: count^2, summed over 19 electrodes (q8 inside); white noise of sigma counts is 19 sigma^2.
#ifndef BIOTAC_NOISE_H
#define BIOTAC_NOISE_H

#include <stdint.h>

typedef struct {
    uint32_t count2; // 0 until measured
    uint32_t mean_q8;
    uint32_t sigma_q4; // counts: one standard deviation of an electrode, for white noise
    uint8_t sweeps;    // in the mean, at most MEAN_SWEEPS
} bt_noise;

// Add a sweep at rest. deviation_q6: squared distance of a count from the sweep's mean, summed over all
// electrodes. A slow load hardly shows in it.
void bt_noise_add(bt_noise *noise, uint32_t deviation_q6, uint32_t setting_count2);

// Energy above which a round counts as touched: the setting, or three times the noise if larger.
uint32_t bt_noise_threshold(const bt_noise *noise, uint32_t setting_count2);

#endif
