#include "history.h"

#include "fix.h"

#define NOISE_LAG     3 // medians of three share no sample at this distance
#define MOTION_FRAMES 5

_Static_assert(BT_MEAN_FRAMES + 2 <= BT_HISTORY_FRAMES, "the oldest median needs two frames more");
_Static_assert(2 * MOTION_FRAMES <= BT_HISTORY_FRAMES, "motion compares two runs of frames");

void bt_history_reset(bt_history *history)
{
    for (int k = 0; k < BT_HISTORY_FRAMES; k++) {
        for (int i = 0; i < BT_ELECTRODES; i++) {
            history->counts[k][i] = BT_INVALID_COUNT;
        }
        history->pdc[k] = BT_INVALID_COUNT;
    }
    history->head = 0;
    history->filled = 0;
    history->pdc_now = false;
}

void bt_history_restart(bt_history *history)
{
    history->filled = 0;
}

static int index_ago(const bt_history *history, int ago)
{
    return (history->head + BT_HISTORY_FRAMES - ago) % BT_HISTORY_FRAMES;
}

void bt_history_add(bt_history *history, const bt_frame *frame)
{
    const uint16_t *before = history->counts[history->head];
    uint8_t next = (uint8_t)((history->head + 1) % BT_HISTORY_FRAMES);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t count = frame->electrode[i];
        bool usable = count != BT_INVALID_COUNT && !bt_count_railed(count);
        if (usable && before[i] == BT_INVALID_COUNT) {
            // The first word ever: no mean and no median may reach to before it.
            for (int k = 0; k < BT_HISTORY_FRAMES; k++) {
                history->counts[k][i] = count;
            }
        }
        history->counts[next][i] = usable ? count : before[i];
    }
    // A pressure at the end of its range says nothing about contact.
    history->pdc_now = frame->pdc != BT_INVALID_COUNT && !bt_count_railed(frame->pdc);
    uint16_t pdc_before = history->pdc[history->head];
    if (history->pdc_now && pdc_before == BT_INVALID_COUNT) {
        for (int k = 0; k < BT_HISTORY_FRAMES; k++) {
            history->pdc[k] = frame->pdc;
        }
    }
    history->pdc[next] = history->pdc_now ? frame->pdc : pdc_before;
    history->head = next;
    if (history->filled < BT_HISTORY_FRAMES) {
        history->filled++;
    }
}

bool bt_history_known(const bt_history *history, int electrode)
{
    return history->counts[history->head][electrode] != BT_INVALID_COUNT;
}

static uint16_t median3(uint16_t a, uint16_t b, uint16_t c)
{
    uint16_t low = a < b ? a : b;
    uint16_t high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

uint16_t bt_history_median(const bt_history *history, int electrode, int ago)
{
    int middle = ago + 1 < history->filled ? ago + 1 : ago;
    int oldest = ago + 2 < history->filled ? ago + 2 : middle;
    return median3(history->counts[index_ago(history, ago)][electrode],
                   history->counts[index_ago(history, middle)][electrode],
                   history->counts[index_ago(history, oldest)][electrode]);
}

uint16_t bt_history_pdc_median(const bt_history *history)
{
    int middle = history->filled > 1 ? 1 : 0;
    int oldest = history->filled > 2 ? 2 : middle;
    return median3(history->pdc[index_ago(history, 0)], history->pdc[index_ago(history, middle)],
                   history->pdc[index_ago(history, oldest)]);
}

static int mean_frames(const bt_history *history)
{
    return history->filled < BT_MEAN_FRAMES ? history->filled : BT_MEAN_FRAMES;
}

uint32_t bt_history_mean_q16(const bt_history *history, int electrode)
{
    int frames = mean_frames(history);
    uint32_t sum = 0;
    for (int k = 0; k < frames; k++) {
        sum += history->counts[index_ago(history, k)][electrode];
    }
    return (uint32_t)bt_div_round((int64_t)sum << 16, frames);
}

uint32_t bt_history_settled_q16(const bt_history *history, int electrode)
{
    int frames = mean_frames(history);
    uint32_t sum = 0;
    for (int k = 0; k < frames; k++) {
        sum += bt_history_median(history, electrode, k);
    }
    return (uint32_t)bt_div_round((int64_t)sum << 16, frames);
}

uint32_t bt_history_pdc_mean_q16(const bt_history *history)
{
    int frames = mean_frames(history);
    uint32_t sum = 0;
    for (int k = 0; k < frames; k++) {
        sum += history->pdc[index_ago(history, k)];
    }
    return (uint32_t)bt_div_round((int64_t)sum << 16, frames);
}

uint32_t bt_history_motion(const bt_history *history)
{
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t change = 0;
        for (int k = 0; k < MOTION_FRAMES; k++) {
            change += history->counts[index_ago(history, k)][i];
            change -= history->counts[index_ago(history, k + MOTION_FRAMES)][i];
        }
        sum += (int64_t)change * change;
    }
    return (uint32_t)bt_div_round(sum, MOTION_FRAMES * MOTION_FRAMES);
}

uint32_t bt_history_noise(const bt_history *history)
{
    if (history->filled < NOISE_LAG + 3) {
        return 0;
    }
    uint32_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t change = bt_history_median(history, i, 0) - bt_history_median(history, i, NOISE_LAG);
        sum += (uint32_t)(change * change);
    }
    return sum / 2;
}

bool bt_history_still(const bt_history *history, int span)
{
    if (history->filled < BT_MEAN_FRAMES + 2) {
        return false;
    }
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint16_t low = UINT16_MAX;
        uint16_t high = 0;
        for (int k = 0; k < BT_MEAN_FRAMES; k++) {
            uint16_t m = bt_history_median(history, i, k);
            low = m < low ? m : low;
            high = m > high ? m : high;
        }
        if (high - low > span) {
            return false;
        }
    }
    return true;
}
