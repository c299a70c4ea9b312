#include "history.h"

#include "fix.h"

#include <string.h>

#define NOISE_LAG     3 // medians of three share no sample at this distance
#define MOTION_FRAMES 5

_Static_assert((BT_HISTORY_FRAMES & (BT_HISTORY_FRAMES - 1)) == 0, "indices are masked");
_Static_assert((BT_MEAN_FRAMES & (BT_MEAN_FRAMES - 1)) == 0, "indices are masked");
_Static_assert(BT_MEAN_FRAMES < BT_HISTORY_FRAMES, "a sum gives back the count that leaves its window");
_Static_assert(2 * MOTION_FRAMES <= BT_HISTORY_FRAMES, "motion compares two runs of frames");
_Static_assert(BT_MEAN_FRAMES *BT_FULL_SCALE_COUNT <= UINT16_MAX, "a sum must fit its type");

void bt_history_reset(bt_history *history)
{
    memset(history, 0, sizeof *history);
    memset(history->counts, 0xFF, sizeof history->counts);
    memset(history->median, 0xFF, sizeof history->median);
    memset(history->pdc, 0xFF, sizeof history->pdc);
}

void bt_history_restart(bt_history *history)
{
    history->filled = 0;
    memset(history->sum, 0, sizeof history->sum);
}

static const uint16_t *counts_ago(const bt_history *history, unsigned ago)
{
    return history->counts[(history->head - ago) & (BT_HISTORY_FRAMES - 1)];
}

static uint16_t pdc_ago(const bt_history *history, unsigned ago)
{
    return history->pdc[(history->head - ago) & (BT_HISTORY_FRAMES - 1)];
}

static unsigned mean_frames(const bt_history *history)
{
    return history->filled < BT_MEAN_FRAMES ? history->filled : BT_MEAN_FRAMES;
}

static uint16_t median3(uint16_t a, uint16_t b, uint16_t c)
{
    uint16_t low = a < b ? a : b;
    uint16_t high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

// The first word of an electrode ever: no mean and no median may reach to before it.
static void begin_electrode(bt_history *history, int i, uint16_t count)
{
    for (int k = 0; k < BT_HISTORY_FRAMES; k++) {
        history->counts[k][i] = count;
    }
    for (int k = 0; k < BT_MEAN_FRAMES; k++) {
        history->median[k][i] = count;
    }
    history->sum[i] = (uint16_t)(count * mean_frames(history));
}

static void add_pdc(bt_history *history, uint16_t pdc, uint8_t next)
{
    uint16_t before = pdc_ago(history, 0);
    // A pressure at the end of its range says nothing about contact.
    history->pdc_now = bt_count_usable(pdc);
    if (history->pdc_now && before == BT_INVALID_COUNT) {
        for (int k = 0; k < BT_HISTORY_FRAMES; k++) {
            history->pdc[k] = pdc;
        }
    }
    history->pdc[next] = history->pdc_now ? pdc : before;
}

void bt_history_add(bt_history *history, const bt_frame *frame)
{
    uint8_t next = (uint8_t)((history->head + 1) & (BT_HISTORY_FRAMES - 1));
    const uint16_t *before = counts_ago(history, 0);
    const uint16_t *oldest = counts_ago(history, history->filled > 1 ? 1 : 0);
    const uint16_t *leaving = counts_ago(history, BT_MEAN_FRAMES - 1);
    bool full = history->filled >= BT_MEAN_FRAMES;
    bool first = history->filled == 0;
    uint16_t *counts = history->counts[next];
    uint16_t *median = history->median[next & (BT_MEAN_FRAMES - 1)];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t count = frame->electrode[i];
        bool usable = bt_count_usable(count);
        if (usable && before[i] == BT_INVALID_COUNT) {
            begin_electrode(history, i, count);
        }
        count = usable ? count : before[i];
        // The slot of `next` is older than all of these rows, so it is written last.
        history->sum[i] = (uint16_t)(history->sum[i] + count - (full ? leaving[i] : 0));
        median[i] = first ? count : median3(count, before[i], oldest[i]);
        counts[i] = count;
    }
    add_pdc(history, frame->pdc, next);
    history->head = next;
    if (history->filled < BT_HISTORY_FRAMES) {
        history->filled++;
    }
}

uint16_t bt_history_pdc_median(const bt_history *history)
{
    unsigned middle = history->filled > 1 ? 1 : 0;
    unsigned oldest = history->filled > 2 ? 2 : middle;
    return median3(pdc_ago(history, 0), pdc_ago(history, middle), pdc_ago(history, oldest));
}

// sum is at most 8 * 4095, so that its q16 fits 32 bits.
static uint32_t mean_of(uint32_t sum, unsigned frames)
{
    return frames == BT_MEAN_FRAMES ? sum << 13 : bt_div_round_u32(sum << 16, frames);
}

_Static_assert(BT_MEAN_FRAMES == 1 << (16 - 13), "the mean of a full window is a shift");

void bt_history_means_q16(const bt_history *history, uint32_t mean_q16[BT_ELECTRODES])
{
    unsigned frames = mean_frames(history);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        mean_q16[i] = mean_of(history->sum[i], frames);
    }
}

uint32_t bt_history_settled_q16(const bt_history *history, int electrode)
{
    unsigned frames = mean_frames(history);
    uint32_t sum = 0;
    for (unsigned k = 0; k < frames; k++) {
        sum += bt_history_medians(history, k)[electrode];
    }
    return mean_of(sum, frames);
}

uint32_t bt_history_pdc_mean_q16(const bt_history *history)
{
    unsigned frames = mean_frames(history);
    uint32_t sum = 0;
    for (unsigned k = 0; k < frames; k++) {
        sum += pdc_ago(history, k);
    }
    return mean_of(sum, frames);
}

uint32_t bt_history_motion(const bt_history *history)
{
    int32_t change[BT_ELECTRODES] = {0};
    for (unsigned k = 0; k < MOTION_FRAMES; k++) {
        const uint16_t *now = counts_ago(history, k);
        const uint16_t *then = counts_ago(history, k + MOTION_FRAMES);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            change[i] += now[i] - then[i];
        }
    }
    uint64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        // At most 5 * 4095 in size: the square fits 32 bits.
        sum += bt_abs32(change[i]) * bt_abs32(change[i]);
    }
    uint32_t capped = sum > UINT32_MAX / 2 ? UINT32_MAX / 2 : (uint32_t)sum;
    return bt_div_round_u32(capped, MOTION_FRAMES * MOTION_FRAMES);
}

uint32_t bt_history_noise(const bt_history *history)
{
    if (history->filled < NOISE_LAG + 3) {
        return 0;
    }
    const uint16_t *now = bt_history_medians(history, 0);
    const uint16_t *then = bt_history_medians(history, NOISE_LAG);
    uint32_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t change = now[i] - then[i];
        sum += (uint32_t)(change * change);
    }
    return sum / 2;
}

bool bt_history_still(const bt_history *history, int span)
{
    if (history->filled < BT_MEAN_FRAMES + 2) {
        return false; // the oldest median rests on two frames more
    }
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t low = UINT16_MAX;
        uint16_t high = 0;
        for (unsigned k = 0; k < BT_MEAN_FRAMES; k++) {
            uint16_t m = bt_history_medians(history, k)[i];
            low = m < low ? m : low;
            high = m > high ? m : high;
        }
        if (high - low > span) {
            return false;
        }
    }
    return true;
}
