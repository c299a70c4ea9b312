// The tare machine: what the sensor reads at rest, per electrode and for static pressure.
//
// Lin's rule (re-tare whenever the sum of squares stays under 1000 count^2) zeroes every load that
// grows slower than about 5 N/s and locks out after the first contact. This machine follows drift
// at a bounded rate while nothing touches, freezes on contact, takes the tare back to before the
// contact began, and re-tares after release once the signals are quiet (protocol/SPEC.md, Tare).
//
// Units: counts; baselines in 1/65536 count (q16); energies in count^2; time in frames of 10 ms.
// One call per frame. Baselines round half away from zero when published in 1/16 count.
#ifndef BIOTAC_TARE_H
#define BIOTAC_TARE_H

#include "history.h"

#define BT_TARE_SNAPSHOTS 8
#define BT_TARE_UNKNOWN   0xFFFFFFFFu // of a channel that was never read

typedef struct {
    uint32_t electrode_q16[BT_ELECTRODES];
    uint32_t pdc_q16;
} bt_baseline;

typedef struct {
    uint8_t state;  // enum bt_tare_state
    uint8_t reason; // enum bt_tare_reason of the last change
    bool changed;   // the last update changed the tare by more than drift tracking
    bt_baseline base;
    uint32_t noise_count2;   // at rest, summed over electrodes; 0 until measured
    uint32_t age_frames;     // since the last change
    uint32_t contact_frames; // since the contact was seen
    bt_history history;

    bt_baseline snapshot[BT_TARE_SNAPSHOTS]; // one per 250 ms at rest
    uint8_t snapshot_head;
    uint8_t snapshots;
    uint8_t snapshot_countdown;

    uint8_t hits;         // consecutive frames over the contact threshold
    uint8_t calm_frames;  // consecutive frames near the tare
    uint8_t still_frames; // consecutive frames that do not move
    uint8_t noise_frames; // rest frames in the noise estimate, up to its length
    uint32_t noise_q8;

    // Of the present contact: its strongest moment, and since when the signals rest where they are.
    uint32_t energy_peak;
    int32_t pdc_peak_q16;
    uint32_t settle_q16[BT_ELECTRODES];
    uint16_t settle_pdc;
    uint8_t settle_frames;
} bt_tare;

void bt_tare_reset(bt_tare *tare);

// Take in one frame. threshold_count2 is the contact_energy setting.
void bt_tare_update(bt_tare *tare, const bt_frame *frame, uint32_t threshold_count2);

// Host commands; enum bt_error. NOW needs ten frames that hold still; both are refused in FAULT.
uint8_t bt_tare_now(bt_tare *tare);
uint8_t bt_tare_set(bt_tare *tare, const bt_baseline *base);

// Energy above which a frame counts as touched: the setting, or four times the noise if larger.
uint32_t bt_tare_threshold_count2(const bt_tare *tare, uint32_t setting_count2);

// A baseline as it is subtracted and published: 1/16 count; BT_INVALID_COUNT when unknown.
#ifndef BT_CDEF
static inline uint16_t bt_tare_q4(uint32_t base_q16)
{
    return base_q16 == BT_TARE_UNKNOWN ? BT_INVALID_COUNT : (uint16_t)((base_q16 + (1 << 11)) >> 12);
}
#endif

#endif
