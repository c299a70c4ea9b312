#include "touch/inverted.h"

#include "touch/release.h"

#include "fixed_point.h"

#define INVERTED_COUNT2 300
#define DOUBT_ROUNDS    3

_Static_assert(BT_FULL_SCALE_COUNT * 8 <= INT16_MAX, "a change of a count must fit its type");

static int16_t change_q3(uint32_t before_q16, uint32_t now_q16)
{
    if (before_q16 == BT_TARE_UNKNOWN || now_q16 == BT_TARE_UNKNOWN) {
        return 0;
    }
    return (int16_t)bt_shift_down((int32_t)(now_q16 - before_q16), 13);
}

void bt_inverted_note(bt_tare_change *change, const bt_baseline *before, const bt_baseline *now)
{
    change->known = before->electrode_q16[0] != BT_TARE_UNKNOWN;
    change->rounds = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        change->electrode_q3[i] = change_q3(before->electrode_q16[i], now->electrode_q16[i]);
    }
    change->pdc_q3 = change_q3(before->pdc_q16, now->pdc_q16);
}

// Sums over the electrodes that have a tare, in counts.
typedef struct {
    int32_t net;      // of the signals
    uint32_t energy;  // of the signals
    int32_t along;    // signals times change
    uint32_t changed; // energy of the change
} sums;

_Static_assert(BT_ELECTRODES *(int64_t)BT_FULL_SCALE_COUNT *BT_FULL_SCALE_COUNT <= INT32_MAX,
               "products of counts over all electrodes must fit 32 bits");

static sums sums_of(const bt_tare_change *change, const bt_lanes *smooth, const bt_baseline *base)
{
    sums s = {0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        uint32_t base_q16 = base->electrode_q16[i];
        if (base_q16 == BT_TARE_UNKNOWN || smooth->lane[i] > BT_FULL_SCALE_COUNT) {
            continue;
        }
        int32_t e = smooth->lane[i] - (int32_t)(base_q16 >> 16);
        int32_t d = bt_shift_down(change->electrode_q3[i], 3);
        s.net += e;
        s.energy += (uint32_t)(e * e);
        s.along += e * d;
        s.changed += (uint32_t)(d * d);
    }
    return s;
}

// True if the signals are the last change of the tare upside down, within 45 degrees.
static bool is_the_change(const sums *s)
{
    uint64_t along = s->along < 0 ? (uint64_t)-(int64_t)s->along : 0;
    return 2 * along * along > (uint64_t)s->energy * s->changed;
}

bt_tare_doubt bt_inverted_judge(bt_tare_change *change, const bt_lanes *smooth, const bt_baseline *base,
                                int32_t pdc_peak, bool colder)
{
    bt_tare_doubt doubt = BT_TARE_STANDS;
    int32_t below = (int32_t)(base->pdc_q16 >> 16) - smooth->lane[BT_LANE_PDC];
    if (base->pdc_q16 != BT_TARE_UNKNOWN && below > bt_pdc_missing_max(pdc_peak)) {
        sums s = sums_of(change, smooth, base);
        if (s.energy <= INVERTED_COUNT2) {
            doubt = BT_TARE_STANDS;
        } else if (change->known && is_the_change(&s)) {
            doubt = BT_TARE_UNDO;
        } else if (s.net > 0 || !colder) {
            doubt = BT_TARE_LOSE;
        }
    }
    change->rounds = doubt == BT_TARE_STANDS ? 0 : (uint8_t)(change->rounds + 1);
    return change->rounds < DOUBT_ROUNDS ? BT_TARE_STANDS : doubt;
}

void bt_inverted_undo(const bt_tare_change *change, bt_baseline *base)
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        base->electrode_q16[i] =
            bt_baseline_moved(base->electrode_q16[i], -change->electrode_q3[i] * (1 << 13));
    }
    base->pdc_q16 = bt_baseline_moved(base->pdc_q16, -change->pdc_q3 * (1 << 13));
}
