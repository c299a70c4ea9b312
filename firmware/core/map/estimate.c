#include "map/estimate.h"

#include "fixed_point.h"
#include "map/estimates_gen.h"
#include "signal/round.h"
#include "signal/signals.h"

// Signals count without noise, and by a quarter above the knee: no one electrode should decide alone.
#define NOISE_Q4 (8 * 16)
#define KNEE_Q4  (256 * 16)
#define MOST_Q4  (KNEE_Q4 + BT_E_MAX_Q4 / 4)

#define PASSES 8 // of two electrodes, each estimated from the other's latest estimate too

_Static_assert(127ll * MOST_Q4 * BT_ELECTRODES <= INT32_MAX, "an estimate must fit int32");

static int32_t bounded(int32_t e_q4)
{
    uint32_t size = bt_abs32(e_q4);
    size = size > NOISE_Q4 ? size - NOISE_Q4 : 0;
    return bt_with_sign(size > KNEE_Q4 ? KNEE_Q4 + ((size - KNEE_Q4) >> 2) : size, e_q4);
}

static int32_t unbounded(int32_t x)
{
    uint32_t size = bt_abs32(x);
    size = size > KNEE_Q4 ? KNEE_Q4 + ((size - KNEE_Q4) << 2) : size;
    return bt_with_sign(size > 0 ? size + NOISE_Q4 : 0, x);
}

static int32_t estimate(const int32_t x[BT_ELECTRODES], int electrode)
{
    int32_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += bt_estimate_weight[electrode][i] * x[i];
    }
    return bt_clamp(bt_shift_down(sum, BT_ESTIMATE_BITS), -MOST_Q4, MOST_Q4);
}

void bt_complete(const uint16_t counts[BT_ELECTRODES], const uint16_t tare_q4[BT_ELECTRODES],
                 uint32_t without, uint16_t completed[BT_ELECTRODES])
{
    int32_t x[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        completed[i] = counts[i] == 0 ? 1 : counts[i];
    }
    if (!bt_usable_without(without)) {
        return;
    }
    bt_signals_q4(completed, tare_q4, x);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        x[i] = without >> i & 1 ? 0 : bounded(x[i]);
    }
    for (int pass = 0; pass < PASSES; pass++) {
        for (int i = 0; without >> i != 0; i++) {
            x[i] = without >> i & 1 ? estimate(x, i) : x[i];
        }
    }
    for (int i = 0; without >> i != 0; i++) {
        if (without >> i & 1 && tare_q4[i] != BT_INVALID_COUNT) {
            int32_t count = bt_shift_down(tare_q4[i] + unbounded(x[i]) + 8, 4);
            completed[i] = (uint16_t)bt_clamp(count, 1, BT_RAIL_COUNT - 1);
        }
    }
}
