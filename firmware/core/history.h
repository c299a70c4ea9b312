// The last sixteen frames of one finger, and what the tare machine measures on them.
//
// A missing or railed word repeats the one before it, so that one bad word neither looks like motion
// nor enters a tare; what is repeated is never published. An electrode that was never read well has
// BT_INVALID_COUNT throughout and takes no part in any measure.
//
// Units: counts; means in 1/65536 count (q16), rounded half away from zero; energies in count^2
// summed over electrodes. "ago" counts frames back from the latest, 0.
#ifndef BIOTAC_HISTORY_H
#define BIOTAC_HISTORY_H

#include "assembly.h"

#define BT_HISTORY_FRAMES 16 // a power of two, or taking indices modulo it costs a division
#define BT_MEAN_FRAMES    8  // frames in a mean that a tare may be taken from

typedef struct {
    uint16_t counts[BT_HISTORY_FRAMES][BT_ELECTRODES];
    uint16_t median[BT_MEAN_FRAMES][BT_ELECTRODES]; // of each of the latest counts and the two before
    uint16_t sum[BT_ELECTRODES];     // of the latest BT_MEAN_FRAMES counts, or as many as there are
    uint16_t pdc[BT_HISTORY_FRAMES]; // BT_INVALID_COUNT until pressure was read once
    uint8_t head;                    // the latest entry
    uint8_t filled;                  // valid entries, at most BT_HISTORY_FRAMES
    bool pdc_now;                    // the latest frame had a usable pressure word
} bt_history;

void bt_history_reset(bt_history *history);

// Forget the frames, but not which electrodes and whether pressure were ever read.
void bt_history_restart(bt_history *history);

void bt_history_add(bt_history *history, const bt_frame *frame);

#ifndef BT_CDEF
// Medians of three consecutive counts ending `ago` (below BT_MEAN_FRAMES): a single-sample glitch alone
// exceeds the contact threshold, and one frame in ten has one. BT_INVALID_COUNT for an electrode that
// was never read well.
static inline const uint16_t *bt_history_medians(const bt_history *history, unsigned ago)
{
    return history->median[(history->head - ago) & (BT_MEAN_FRAMES - 1)];
}

static inline bool bt_history_known(const bt_history *history, int electrode)
{
    return bt_history_medians(history, 0)[electrode] != BT_INVALID_COUNT;
}
#endif

uint16_t bt_history_pdc_median(const bt_history *history);

// Means of the last eight counts, or of as many as there are.
void bt_history_means_q16(const bt_history *history, uint32_t mean_q16[BT_ELECTRODES]);

// Mean of the last eight medians: for a new tare, which a glitch must not shift.
uint32_t bt_history_settled_q16(const bt_history *history, int electrode);
uint32_t bt_history_pdc_mean_q16(const bt_history *history);

// Energy of the change between the mean of the last five frames and that of the five before.
uint32_t bt_history_motion(const bt_history *history);

// Half the energy of the change of the medians over three frames: the noise energy of a resting
// finger, and hardly more while a slow load builds up. 0 before there are enough frames.
uint32_t bt_history_noise(const bt_history *history);

// No electrode's medians of the last eight frames span more than span counts.
bool bt_history_still(const bt_history *history, int span);

#endif
