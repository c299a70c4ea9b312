#include "touch/adopt.h"

#include "fixed_point.h"

#define UNDERSHOOT_PDC_COUNT_MAX 16 // of pressure after a press, which comes back

void bt_adopt_aim_pressure(bt_tare *tare)
{
    uint32_t base_q16 = tare->base.pdc_q16;
    uint32_t watched_q16 = bt_adopt_trigger_base(tare)->pdc_q16;
    // Pressure is low for a second or two after a press that ends in doubt; its return is no touch.
    if (base_q16 != BT_TARE_UNKNOWN && watched_q16 != BT_TARE_UNKNOWN && watched_q16 > base_q16) {
        base_q16 = watched_q16;
    }
    if (!(tare->trigger.unknown >> BT_LANE_PDC & 1)) {
        tare->trigger.rest.lane[BT_LANE_PDC] =
            base_q16 == BT_TARE_UNKNOWN ? 0 : (uint16_t)bt_baseline_count(base_q16);
    }
}

void bt_adopt_aim(bt_tare *tare)
{
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        bt_adopt_aim_electrode(tare, i);
    }
    bt_adopt_aim_pressure(tare);
}

void bt_adopt_report(bt_tare *tare, uint8_t reason)
{
    tare->reason = reason;
    tare->changed = true;
    tare->age_rounds = 0;
}

void bt_adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason)
{
    tare->base = *base;
    tare->state = state;
    tare->tared = true;
    bt_adopt_report(tare, reason);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        bt_adopt_electrode(tare, i);
    }
    bt_adopt_aim_pressure(tare);
    tare->hits = 0;
    tare->contact_rounds = 0;
    tare->released = false;
    tare->release = (bt_release){0};
    bt_thermal_begin(&tare->thermal);
    bt_watch_begin(&tare->watch);
    bt_rollback_start(&tare->rollback, base);
    tare->partial = true;
}

void bt_adopt_present(bt_tare *tare, uint8_t reason)
{
    bt_baseline base;
    bt_baseline_present(&base, &tare->sweep, tare->trigger.unknown);
    bt_adopt(tare, &base, BT_TARE_STATE_REST, reason);
}

void bt_adopt_after_press(bt_tare *tare, uint8_t reason)
{
    uint32_t rest_q16 = tare->base.pdc_q16;
    bt_adopt_present(tare, reason);
    uint32_t present = tare->base.pdc_q16;
    if (rest_q16 != BT_TARE_UNKNOWN && present < rest_q16
        && rest_q16 - present < UNDERSHOOT_PDC_COUNT_MAX << 16) {
        tare->base.pdc_q16 = rest_q16;
        bt_rollback_start(&tare->rollback, &tare->base);
        bt_adopt_aim_pressure(tare);
    }
}

void bt_adopt_shift(bt_tare *tare)
{
    bt_baseline base;
    bt_baseline_present(&base, &tare->sweep, tare->trigger.unknown);
    int32_t shift_q16 = (int32_t)bt_div_round((int64_t)tare->sum_q4 * (1 << 12), BT_ELECTRODES);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        base.electrode_q16[i] = bt_baseline_moved(tare->base.electrode_q16[i], shift_q16);
    }
    bt_adopt(tare, &base, BT_TARE_STATE_REST, BT_TARE_REASON_SHIFT);
}

void bt_adopt_doubt(bt_tare *tare)
{
    bt_watch_store(&tare->watch, &tare->sweep, tare->trigger.unknown);
    tare->state = BT_TARE_STATE_DOUBT;
    tare->hits = 0;
    bt_adopt_aim(tare);
}

void bt_adopt_contact(bt_tare *tare)
{
    tare->state = BT_TARE_STATE_CONTACT;
    tare->hits = 0;
    bt_adopt_aim(tare);
}

// A late first word counts as rest, or it would look like a contact. A tare of the host stays.
static void adopt_first_word(bt_tare *tare, unsigned lane)
{
    uint32_t first_q16 = (uint32_t)tare->trigger.smooth.lane[lane] << 16;
    bt_sweep_fill(&tare->sweep, lane, tare->trigger.smooth.lane[lane]);
    bool tared = lane == BT_LANE_PDC ? tare->state == BT_TARE_STATE_REST : tare->tared;
    if (tared && tare->base.lane_q16[lane] == BT_TARE_UNKNOWN) {
        tare->base.lane_q16[lane] = first_q16;
        bt_rollback_fill(&tare->rollback, lane, first_q16);
    }
    if (lane == BT_LANE_PDC) {
        bt_adopt_aim_pressure(tare);
    } else {
        bt_adopt_electrode(tare, lane);
    }
}

BT_NOINLINE void bt_adopt_first_words(bt_tare *tare)
{
    for (unsigned lane = 0; tare->trigger.first_words >> lane != 0; lane++) {
        if (tare->trigger.first_words >> lane & 1) {
            adopt_first_word(tare, lane);
        }
    }
    tare->trigger.first_words = 0;
}

void bt_discard_tare(bt_tare *tare)
{
    bt_adopt_report(tare, BT_TARE_REASON_INVERTED);
    tare->state = BT_TARE_STATE_INIT;
    tare->tared = false;
    tare->inverted_rounds = 0;
    tare->hits = 0;
    tare->partial = true;
    bt_sweep_restart(&tare->sweep);
}
